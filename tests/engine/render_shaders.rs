//! The shaders of pictures, validated without a GPU, and their inputs compared with the host's.

use std::mem::offset_of;

use firn::render::{Prism, SHADERS, ShaderView, Vertex};
use naga::{Binding, ShaderStage, TypeInner};

fn parse(name: &str, source: &str) -> naga::Module {
    let module = naga::front::wgsl::parse_str(source)
        .unwrap_or_else(|error| panic!("{name}: {}", error.emit_to_string(source)));
    let capabilities = naga::valid::Capabilities::empty();
    naga::valid::Validator::new(naga::valid::ValidationFlags::all(), capabilities)
        .validate(&module)
        .unwrap_or_else(|error| panic!("{name}: {error:?}"));
    module
}

fn members<'a>(module: &'a naga::Module, name: &str) -> (&'a [naga::StructMember], u32) {
    let mut types = module.types.iter();
    let found = types.find_map(|(_, ty)| match &ty.inner {
        TypeInner::Struct { members, span } if ty.name.as_deref() == Some(name) => {
            Some((members.as_slice(), *span))
        }
        _ => None,
    });
    found.unwrap_or_else(|| panic!("no struct {name}"))
}

#[test]
fn shaders_are_valid_and_take_the_view_as_the_host_lays_it_out() {
    for (name, source) in SHADERS {
        let module = parse(name, &source.join("\n"));
        for (stage, ending) in
            [(ShaderStage::Vertex, "vertex"), (ShaderStage::Fragment, "fragment")]
        {
            let entry = format!("{name}_{ending}");
            let mut entries = module.entry_points.iter();
            assert!(entries.any(|point| point.name == entry && point.stage == stage), "{entry}");
        }
        let (view, span) = members(&module, "View");
        let found: Vec<_> =
            view.iter().map(|member| (member.name.as_deref().unwrap(), member.offset)).collect();
        let host = [
            ("clip", offset_of!(ShaderView, clip)),
            ("eye", offset_of!(ShaderView, eye)),
            ("light", offset_of!(ShaderView, light)),
            ("shading", offset_of!(ShaderView, shading)),
        ]
        .map(|(name, offset)| (name, offset as u32));
        assert_eq!(found, host, "{name}");
        assert_eq!(span as usize, size_of::<ShaderView>());
    }
}

/// The names of a struct's members by their locations.
fn locations(module: &naga::Module, name: &str) -> Vec<(u32, String)> {
    let location = |member: &naga::StructMember| match member.binding {
        Some(Binding::Location { location, .. }) => location,
        _ => panic!("{name}: {:?} has no location", member.name),
    };
    let (members, _) = members(module, name);
    members.iter().map(|member| (location(member), member.name.clone().unwrap())).collect()
}

macro_rules! assert_order {
    ($module:expr, $name:ident { $($field:ident),* }) => {{
        let offsets = [$(offset_of!($name, $field)),*];
        assert!(offsets.is_sorted(), "attributes are read one after the other");
        let host: Vec<_> = (0u32..).zip([$(stringify!($field).to_owned()),*]).collect();
        assert_eq!(locations(&$module, stringify!($name)), host);
    }};
}

#[test]
fn boxes_and_corners_are_read_field_by_field() {
    let [prisms, mesh] = SHADERS.map(|(name, source)| parse(name, &source.join("\n")));
    assert_order!(prisms, Prism { low, value, high, paint, faces });
    assert_order!(mesh, Vertex { position, value, normal, paint });
}
