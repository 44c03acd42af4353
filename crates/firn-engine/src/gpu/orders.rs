//! Rows that the host makes anew for every submit: objects, jobs, and what falls. What the device
//! has already is not sent again.

use bytemuck::Pod;

use super::buffer::{Mail, Table};
use super::device::Device;
use super::kernels::Resource;
use super::layout::{
    Collider, ColumnJob, EditJob, LoadJob, Operation, SampleJob, ShadeJob, Shelter, Stamp,
    WeatherJob, WeatherStep,
};
use super::sections::{Sections, pieces};

const SECTIONS: usize = 17;

/// The rows of the submit that is being made.
#[derive(Debug)]
pub struct Orders {
    /// Objects.
    pub colliders: Rows<Collider>,
    /// Spans of columns under objects.
    pub spans: Rows<[u32; 2]>,
    /// How high undersides that are not flat are over the columns.
    pub lifts: Rows<u32>,
    /// Tiles whose stress is to be evaluated.
    pub load_jobs: Rows<LoadJob>,
    /// Objects on those tiles.
    pub loads: Rows<u32>,
    /// Tiles on which snow falls or is cleared.
    pub edit_jobs: Rows<EditJob>,
    /// What falls or is cleared.
    pub operations: Rows<Operation>,
    /// Which of it touches each of those tiles.
    pub operation_lists: Rows<u32>,
    /// Boxes of the fixed grid that are asked for.
    pub sample_jobs: Rows<SampleJob>,
    /// Columns that are to be read, all of them equally deep.
    pub column_jobs: Rows<ColumnJob>,
    /// Which columns those are.
    pub column_lists: Rows<u32>,
    /// Loads that press columns at once.
    pub stamps: Rows<Stamp>,
    /// How much of each column they cover.
    pub shares: Rows<u32>,
    /// Snowpacks that take steps of weather, and on which tiles.
    pub weather_jobs: Rows<WeatherJob>,
    /// Those steps.
    pub weather_steps: Rows<WeatherStep>,
    /// Tiles with columns on which no snow falls because of objects.
    pub shelters: Rows<Shelter>,
    /// Snowpacks on each column of which another part of the short wave falls.
    pub shade_jobs: Rows<ShadeJob>,
    sections: Sections<SECTIONS>,
    /// The buffer as the device has it.
    image: Vec<u8>,
}

/// Rows of one kind.
#[derive(Debug)]
pub struct Rows<T>(Vec<T>);

impl<T: Pod> Rows<T> {
    /// Adds a row and returns its number.
    pub fn push(&mut self, row: T) -> u32 {
        self.0.push(row);
        self.len() - 1
    }

    /// Adds rows.
    pub fn extend(&mut self, rows: impl IntoIterator<Item = T>) {
        self.0.extend(rows);
    }

    /// Number of rows.
    pub fn len(&self) -> u32 {
        self.0.len() as u32
    }

    fn bytes(&self) -> &[u8] {
        bytemuck::cast_slice(&self.0)
    }
}

impl Orders {
    /// No rows.
    pub fn new(table: Table) -> Orders {
        Orders {
            colliders: Rows(Vec::new()),
            spans: Rows(Vec::new()),
            lifts: Rows(Vec::new()),
            load_jobs: Rows(Vec::new()),
            loads: Rows(Vec::new()),
            edit_jobs: Rows(Vec::new()),
            operations: Rows(Vec::new()),
            operation_lists: Rows(Vec::new()),
            sample_jobs: Rows(Vec::new()),
            column_jobs: Rows(Vec::new()),
            column_lists: Rows(Vec::new()),
            stamps: Rows(Vec::new()),
            shares: Rows(Vec::new()),
            weather_jobs: Rows(Vec::new()),
            weather_steps: Rows(Vec::new()),
            shelters: Rows(Vec::new()),
            shade_jobs: Rows(Vec::new()),
            sections: Sections::new(table),
            image: Vec::new(),
        }
    }

    /// What a kernel binds; `None` where it is none of these rows.
    pub fn binding(&self, resource: Resource) -> Option<wgpu::BindingResource<'_>> {
        let section = match resource {
            Resource::Colliders => 0,
            Resource::Spans => 1,
            Resource::LoadJobs => 2,
            Resource::Loads => 3,
            Resource::EditJobs => 4,
            Resource::Operations => 5,
            Resource::OperationLists => 6,
            Resource::SampleJobs => 7,
            Resource::ColumnJobs => 8,
            Resource::ColumnLists => 9,
            Resource::Lifts => 10,
            Resource::Stamps => 11,
            Resource::Shares => 12,
            Resource::WeatherJobs => 13,
            Resource::WeatherSteps => 14,
            Resource::Shelters => 15,
            Resource::ShadeJobs => 16,
            _ => return None,
        };
        Some(self.sections.binding(section))
    }

    /// Gives the rows that the device does not have to the mail, and forgets all. Returns whether the
    /// buffer was replaced.
    pub fn flush(&mut self, device: &Device, mail: &mut Mail) -> bool {
        let bytes: [&[u8]; SECTIONS] = [
            self.colliders.bytes(),
            self.spans.bytes(),
            self.load_jobs.bytes(),
            self.loads.bytes(),
            self.edit_jobs.bytes(),
            self.operations.bytes(),
            self.operation_lists.bytes(),
            self.sample_jobs.bytes(),
            self.column_jobs.bytes(),
            self.column_lists.bytes(),
            self.lifts.bytes(),
            self.stamps.bytes(),
            self.shares.bytes(),
            self.weather_jobs.bytes(),
            self.weather_steps.bytes(),
            self.shelters.bytes(),
            self.shade_jobs.bytes(),
        ];
        let sizes = bytes.map(|bytes| bytes.len() as u64);
        let replaced = self.sections.reserve(device, sizes);
        if replaced {
            self.image.clear();
            self.image.resize(self.sections.size() as usize, 0);
        }
        let mut changed = self.sections.places(sizes);
        for (place, bytes) in changed.iter_mut().zip(bytes) {
            let known = &mut self.image[place.start as usize..place.end as usize];
            if known == bytes {
                place.end = place.start;
            } else {
                known.copy_from_slice(bytes);
            }
        }
        for piece in pieces(&changed) {
            let bytes = &self.image[piece.start as usize..piece.end as usize];
            mail.write(self.sections.buffer(), piece.start, bytes);
        }
        self.colliders.0.clear();
        self.spans.0.clear();
        self.load_jobs.0.clear();
        self.loads.0.clear();
        self.edit_jobs.0.clear();
        self.operations.0.clear();
        self.operation_lists.0.clear();
        self.sample_jobs.0.clear();
        self.column_jobs.0.clear();
        self.column_lists.0.clear();
        self.lifts.0.clear();
        self.stamps.0.clear();
        self.shares.0.clear();
        self.weather_jobs.0.clear();
        self.weather_steps.0.clear();
        self.shelters.0.clear();
        self.shade_jobs.0.clear();
        replaced
    }
}
