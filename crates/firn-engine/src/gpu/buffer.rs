//! Buffers that grow, and what carries the host's bytes to them.

/// Bytes of mail that travel together.
const MAIL_BYTES: u64 = 1 << 18;

/// Bytes of mail for which memory is kept. What is larger is rare, and travels by itself.
const LARGEST_MAIL: usize = 1 << 22;

/// Smallest buffer that is made, so that none is empty.
const SMALLEST: u64 = 256;

/// A buffer on the device that is replaced by a larger one when it is outgrown.
#[derive(Debug)]
pub struct Table {
    label: &'static str,
    usage: wgpu::BufferUsages,
    /// Largest size that can be bound \[bytes\].
    most: u64,
    buffer: wgpu::Buffer,
}

impl Table {
    /// A buffer of a size in bytes.
    pub fn new(
        device: &wgpu::Device,
        label: &'static str,
        usage: wgpu::BufferUsages,
        size: u64,
    ) -> Table {
        let limits = device.limits();
        let most = limits.max_storage_buffer_binding_size.min(limits.max_buffer_size);
        Table { label, usage, most, buffer: make(device, label, usage, size) }
    }

    /// The buffer as it is now.
    pub fn buffer(&self) -> &wgpu::Buffer {
        &self.buffer
    }

    /// Size in bytes.
    pub fn size(&self) -> u64 {
        self.buffer.size()
    }

    /// Makes room for `size` bytes; what was there is lost where it grows. Returns whether it did.
    pub fn reserve(&mut self, device: &wgpu::Device, size: u64) -> bool {
        if size <= self.size() {
            return false;
        }
        let ample = size.next_power_of_two().min(self.most).max(size);
        self.buffer = make(device, self.label, self.usage, ample);
        true
    }

    /// Replaces the buffer by a new one of the same size. The old one lives on where a clone of it is held.
    pub fn replace(&mut self, device: &wgpu::Device) {
        self.buffer = make(device, self.label, self.usage, self.size());
    }

    /// A buffer of another size for the same, still without contents.
    pub fn another(&self, device: &wgpu::Device, size: u64) -> wgpu::Buffer {
        make(device, self.label, self.usage, size)
    }

    /// Replaces the buffer by one of `size` bytes that begins with the same contents.
    pub fn grow(&mut self, device: &wgpu::Device, queue: &wgpu::Queue, size: u64) {
        let larger = self.another(device, size);
        self.move_to(larger, device, queue);
    }

    /// Moves the contents to a larger buffer.
    pub fn move_to(&mut self, larger: wgpu::Buffer, device: &wgpu::Device, queue: &wgpu::Queue) {
        let mut encoder = device.create_command_encoder(&Default::default());
        encoder.copy_buffer_to_buffer(&self.buffer, 0, &larger, 0, self.size());
        queue.submit([encoder.finish()]);
        self.buffer = larger;
    }
}

fn make(
    device: &wgpu::Device,
    label: &'static str,
    usage: wgpu::BufferUsages,
    size: u64,
) -> wgpu::Buffer {
    device.create_buffer(&wgpu::BufferDescriptor {
        label: Some(label),
        size: size.max(SMALLEST).next_multiple_of(4),
        usage,
        mapped_at_creation: false,
    })
}

/// Carries what the host has to say to the device: all of it in one piece, through memory that is
/// used again and again.
#[derive(Debug)]
pub struct Mail {
    belt: wgpu::util::StagingBelt,
    bytes: Vec<u8>,
    /// Where each part goes: a buffer, an offset in it, and a number of bytes.
    parts: Vec<(wgpu::Buffer, u64, u64)>,
}

impl Mail {
    /// Nothing to say yet.
    pub fn new(device: &wgpu::Device) -> Mail {
        let belt = wgpu::util::StagingBelt::new(device.clone(), MAIL_BYTES);
        Mail { belt, bytes: Vec::new(), parts: Vec::new() }
    }

    /// Adds bytes, a multiple of 4 of them.
    pub fn write(&mut self, target: &wgpu::Buffer, offset: u64, bytes: &[u8]) {
        if bytes.is_empty() {
            return;
        }
        self.bytes.extend_from_slice(bytes);
        let count = bytes.len() as u64;
        match self.parts.last_mut() {
            Some((last, start, length)) if last == target && *start + *length == offset => {
                *length += count;
            }
            _ => self.parts.push((target.clone(), offset, count)),
        }
    }

    /// Encodes everything that was added. The commands before in `encoder` may see it already.
    pub fn send(&mut self, queue: &wgpu::Queue, encoder: &mut wgpu::CommandEncoder) {
        if self.bytes.len() > LARGEST_MAIL {
            let mut rest = &self.bytes[..];
            for (target, offset, bytes) in self.parts.drain(..) {
                let (part, after) = rest.split_at(bytes as usize);
                queue.write_buffer(&target, offset, part);
                rest = after;
            }
            self.bytes = Vec::new();
            return;
        }
        let Some(size) = wgpu::BufferSize::new(self.bytes.len() as u64) else { return };
        let slice = self.belt.allocate(size, wgpu::BufferSize::MIN);
        let mut from = slice.offset();
        for (target, offset, bytes) in self.parts.drain(..) {
            encoder.copy_buffer_to_buffer(slice.buffer(), from, &target, offset, bytes);
            from += bytes;
        }
        let mut view = slice.get_mapped_range_mut().expect("the belt's memory is mapped");
        view.copy_from_slice(&self.bytes);
        self.bytes.clear();
    }

    /// Ends what is sent in a submit; its memory comes back when the device has read it.
    pub fn finish(&mut self, encoder: &wgpu::CommandEncoder) {
        self.belt.finish_and_recall_on_submit(encoder);
    }
}
