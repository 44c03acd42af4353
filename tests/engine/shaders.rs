//! Every shader validated without a GPU, and its structs compared with the host's.

use std::mem::offset_of;

use firn_engine::gpu::kernels::{Access, KERNELS, Kernel, LARGEST_WORKGROUP, Resource};
use firn_engine::gpu::layout;
use naga::{AddressSpace, StorageAccess, TypeInner};

fn parse(kernel: &Kernel) -> naga::Module {
    let source = kernel.wgsl();
    let module = naga::front::wgsl::parse_str(&source)
        .unwrap_or_else(|error| panic!("{}: {}", kernel.name, error.emit_to_string(&source)));
    naga::valid::Validator::new(
        naga::valid::ValidationFlags::all(),
        naga::valid::Capabilities::IMMEDIATES,
    )
    .validate(&module)
    .unwrap_or_else(|error| panic!("{}: {error:?}", kernel.name));
    module
}

/// `EditJobs` as `edit_jobs`.
fn snake_case(resource: Resource) -> String {
    let mut name = String::new();
    for letter in format!("{resource:?}").chars() {
        if letter.is_uppercase() && !name.is_empty() {
            name.push('_');
        }
        name.extend(letter.to_lowercase());
    }
    name
}

#[test]
fn every_shader_is_valid_and_binds_what_its_kernel_declares() {
    for kernel in &KERNELS {
        let module = parse(kernel);
        assert!(module.entry_points.iter().any(|entry| entry.name == kernel.entry_point));
        let immediates: Vec<_> = module
            .global_variables
            .iter()
            .filter(|(_, variable)| variable.space == AddressSpace::Immediate)
            .map(|(_, variable)| module.types[variable.ty].name.as_deref())
            .collect();
        assert_eq!(immediates, [Some("Pass")], "{}", kernel.name);
        let mut bound: Vec<_> = module
            .global_variables
            .iter()
            .filter_map(|(_, variable)| {
                let access = match variable.space {
                    AddressSpace::Storage { access } if access.contains(StorageAccess::STORE) => {
                        Access::Write
                    }
                    AddressSpace::Storage { .. } => Access::Read,
                    _ => return None,
                };
                let binding = variable.binding.as_ref()?.binding;
                Some((binding, variable.name.clone().unwrap_or_default(), access))
            })
            .collect();
        bound.sort_by_key(|(binding, ..)| *binding);
        let declared: Vec<_> = (0..)
            .zip(kernel.bindings)
            .map(|(i, &(resource, access))| (i, snake_case(resource), access))
            .collect();
        assert_eq!(bound, declared, "{}", kernel.name);
    }
}

macro_rules! compare_layout {
    ($module:expr, $name:ident { $($field:ident),* $(,)? }) => {{
        let host = [$((stringify!($field), offset_of!(layout::$name, $field) as u32)),*];
        let (members, span) = $module
            .types
            .iter()
            .find_map(|(_, ty)| match &ty.inner {
                TypeInner::Struct { members, span }
                    if ty.name.as_deref() == Some(stringify!($name)) => Some((members, *span)),
                _ => None,
            })
            .unwrap_or_else(|| panic!("no struct {}", stringify!($name)));
        let shader: Vec<_> = members
            .iter()
            .map(|member| (member.name.as_deref().unwrap_or_default(), member.offset))
            .collect();
        assert_eq!(shader, host, "{}", stringify!($name));
        assert_eq!(span as usize, size_of::<layout::$name>(), "{}", stringify!($name));
    }};
}

#[test]
fn host_and_shaders_agree_on_every_struct() {
    let kernel = |name: &str| parse(KERNELS.iter().find(|kernel| kernel.name == name).unwrap());
    let module = kernel("stress");
    compare_layout!(
        module,
        Session {
            first_tile,
            tiles_x,
            width,
            depth,
            height,
            hardness_law,
            load_distribution,
            stiffness_exponent,
            density,
            densest,
            metres,
            gold,
        }
    );
    let stamp = kernel("stamp");
    compare_layout!(stamp, Stamp { columns, first_share, result, pressure, width });
    let (weather, shade, totals) = (kernel("weather"), kernel("shade"), kernel("totals"));
    compare_layout!(
        weather,
        WeatherStep {
            seconds,
            air,
            humidity,
            air_density,
            pressure,
            wind,
            shortwave,
            longwave,
            aged,
            young,
            temperature_height,
            wind_height,
            flags,
            snow,
            snow_thickness,
            snow_temperature,
            rain,
            padding,
        }
    );
    compare_layout!(
        weather,
        WeatherJob {
            end,
            end_tile,
            first_step,
            steps,
            exchange,
            first_shelter,
            shelters,
            first_shine,
            skin,
            soil_0,
            soil_1,
            soil_2,
            soil_3,
            padding,
        }
    );
    compare_layout!(weather, Shelter { tile, low, high, padding });
    compare_layout!(weather, ExchangeResult { sums });
    compare_layout!(
        shade,
        ShadeJob {
            sweep_end,
            shade_end,
            session,
            first_shine,
            flags,
            shift,
            first_line,
            sinks,
            east,
            up,
            north,
            diffuse,
            lowest_cells,
            lowest_fraction,
        }
    );
    compare_layout!(totals, ColumnTotals { mass, water, surface });
    compare_layout!(module, Run { cycles, flags, rate, tally, press });
    compare_layout!(module, Tile { session, page, row, shape });
    compare_layout!(module, Tally { last_change, active_tiles, mass_low, mass_high });
    compare_layout!(
        module,
        Collider {
            session,
            contact,
            z0,
            first_span,
            rows,
            columns,
            x0,
            x1,
            area,
            weight,
            placed,
            runs,
            footprints,
            overhang,
            first_lift,
        }
    );
    compare_layout!(module, Elevation { cells, fraction });
    compare_layout!(
        module,
        Contact {
            bottom,
            reference,
            support_low,
            support_high,
            area,
            pressure,
            width,
            resting,
            last_bottom,
            last_support_low,
            last_support_high,
        }
    );
    compare_layout!(module, LoadJob { tile, first_load, loads, padding });
    compare_layout!(
        module,
        EditJob {
            tile,
            first_operation,
            operations,
            sheltered_low,
            sheltered_high,
            stood_on_low,
            stood_on_high,
            padding
        }
    );
    compare_layout!(module, Operation { columns, snow, kind, result, padding });
    compare_layout!(
        module,
        PackedGroup { changed_low, changed_high, awake_low, awake_high, first }
    );
    compare_layout!(module, OperationResult { low, high });
    compare_layout!(module, ColumnJob { first_column, columns, cells, first });
    compare_layout!(module, ColumnCell { mass, thickness, temperature, stress });
    compare_layout!(
        module,
        SampleJob { session, first, x0, y0, z0, width, height, depth, rate, floor }
    );
    compare_layout!(module, Pass { first, count, cycle, cycles, page, flags, length, rate, press });
}

/// The value of a constant of a shader.
fn constant(module: &naga::Module, name: &str) -> f64 {
    let found = module.constants.iter().find(|(_, known)| known.name.as_deref() == Some(name));
    let (_, constant) = found.unwrap_or_else(|| panic!("no constant {name}"));
    match module.global_expressions[constant.init] {
        naga::Expression::Literal(naga::Literal::U32(value)) => f64::from(value),
        naga::Expression::Literal(naga::Literal::F32(value)) => f64::from(value),
        ref other => panic!("{name} is {other:?}"),
    }
}

#[test]
fn shared_constants_are_the_same() {
    let module = parse(&KERNELS[0]);
    for (name, value) in [
        ("TILE_COLUMNS", firn_snow::TILE_COLUMNS),
        ("TILE_SIDE", firn_snow::TILE_SIDE),
        ("CELL", firn_snow::CELL),
        ("CONTACT_DEPTH", firn_snow::CONTACT_DEPTH),
        ("NONE", layout::NO_SESSION),
        ("NONE", layout::Elevation::NONE.fraction),
        ("AWAKE", layout::AWAKE),
        ("DIRTY", layout::DIRTY),
        ("LOADED", layout::LOADED),
        ("WAKE", layout::WAKE),
        ("PUBLISH", layout::PUBLISH),
        ("EDITED", layout::EDITED),
        ("ALWAYS_AWAKE", layout::ALWAYS_AWAKE),
        ("AFTER_EDITS", layout::AFTER_EDITS),
        ("BACKWARDS", layout::BACKWARDS),
        ("UNDER_OBJECTS", layout::UNDER_OBJECTS),
        ("DEPOSIT", layout::DEPOSIT),
    ] {
        assert_eq!(constant(&module, name), f64::from(value), "{name}");
    }
    assert_eq!(constant(&module, "GRAVITY"), f64::from(firn_snow::GRAVITY as f32));
    assert_eq!(constant(&module, "MASS_QUANTUM"), 1.0 / firn_snow::MASS_QUANTA);
}

#[test]
fn no_workgroup_has_more_threads_than_an_adapter_is_asked_for() {
    let threads = |kernel| {
        let entries = parse(kernel).entry_points;
        entries.iter().map(|entry| entry.workgroup_size.iter().product()).max()
    };
    assert_eq!(KERNELS.iter().filter_map(threads).max(), Some(LARGEST_WORKGROUP));
}
