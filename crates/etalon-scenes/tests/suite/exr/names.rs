//! Which channels are taken for what.

use crate::common;

use common::exr_files::{Kind, file, part};
use etalon_scenes::exr_frame::{
    ChannelName, ExrError, ExrOptions, LoadedFrame, MotionDirection, decode_exr,
};
use exr::prelude::{Encoding, Text};

/// What is found among channels of the given names in one part.
fn found(names: &[&str]) -> Result<LoadedFrame, ExrError> {
    let channels: Vec<_> = names.iter().map(|&name| (name, Kind::Half)).collect();
    let part = part(
        "",
        None,
        [10, -20],
        [8, 6],
        Encoding::FAST_LOSSLESS,
        &channels,
    );
    decode_exr(&file([part]), &ExrOptions::default())
}

#[test]
fn usual_names_are_recognised() {
    let colour = |names: &[&str]| {
        found(names)
            .unwrap()
            .channels
            .colour
            .unwrap()
            .map(|name| name.map_or(String::new(), |name| name.channel))
    };
    assert_eq!(colour(&["A", "B", "G", "R", "Z"]), ["R", "G", "B", "A"]);
    assert_eq!(colour(&["G"]), ["", "G", "", ""]);
    assert_eq!(colour(&["A", "Y"]), ["Y", "Y", "Y", "A"]);
    assert_eq!(
        colour(&["diffuse.R", "diffuse.G", "diffuse.B", "R", "G", "B"]),
        ["R", "G", "B", ""]
    );
    let blender = ["Combined.A", "Combined.B", "Combined.G", "Combined.R"];
    let layers = blender.map(|name| format!("View Layer.{name}"));
    let mut names: Vec<_> = layers.iter().map(String::as_str).collect();
    names.extend([
        "View Layer.AO.R",
        "View Layer.AO.G",
        "View Layer.AO.B",
        "View Layer.Depth.Z",
    ]);
    names.extend([
        "View Layer.Normal.X",
        "View Layer.Normal.Y",
        "View Layer.Normal.Z",
    ]);
    names.extend([
        "View Layer.Vector.W",
        "View Layer.Vector.X",
        "View Layer.Vector.Y",
        "View Layer.Vector.Z",
    ]);
    assert_eq!(colour(&names)[0], "View Layer.Combined.R");
    let channels = found(&names).unwrap().channels;
    assert_eq!(channels.depth, Some("View Layer.Depth.Z".into()));
    assert_eq!(channels.normal.unwrap()[2], "View Layer.Normal.Z".into());
    let motion = channels.motion.unwrap();
    assert_eq!(
        (motion.channels[1].clone(), motion.direction),
        ("View Layer.Vector.Y".into(), MotionDirection::Backward)
    );

    let depth = |names: &[&str]| {
        found(&[names, &["R"]].concat())
            .unwrap()
            .channels
            .depth
            .map(|name| name.channel)
    };
    assert_eq!(depth(&["Z"]).as_deref(), Some("Z"));
    assert_eq!(depth(&["Z", "ZBack"]).as_deref(), Some("Z"));
    assert_eq!(depth(&["ZBack"]).as_deref(), Some("ZBack"));
    assert_eq!(depth(&["depth.Z"]).as_deref(), Some("depth.Z"));
    assert_eq!(
        depth(&["depth.R", "depth.G", "depth.B"]).as_deref(),
        Some("depth.R")
    );
    assert_eq!(depth(&["ZDepth"]).as_deref(), Some("ZDepth"));
    assert_eq!(
        depth(&["Pworld.X", "Pworld.Y", "Pworld.Z"]),
        None,
        "a coordinate"
    );
    assert_eq!(
        depth(&["N.X", "N.Y", "N.Z", "volume.Z", "Z"]).as_deref(),
        Some("Z")
    );

    for layer in ["N", "normal", "Normals"] {
        for [x, y, z] in [["X", "Y", "Z"], ["x", "y", "z"], ["R", "G", "B"]] {
            let names = [x, y, z].map(|last| format!("{layer}.{last}"));
            let channels = found(&[&names[0], &names[1], &names[2], "R", "G", "B"])
                .unwrap()
                .channels;
            assert_eq!(
                channels.normal,
                Some(names.clone().map(|name| ChannelName::new("", name)))
            );
            assert_eq!(
                channels.colour.unwrap()[0],
                Some("R".into()),
                "not the normals"
            );
        }
    }
    let both = found(&["R", "back.u", "back.v", "forward.u", "forward.v"])
        .unwrap()
        .channels
        .motion
        .unwrap();
    assert_eq!(
        both.direction,
        MotionDirection::Backward,
        "velocity is about the frame before"
    );

    for names in [
        &["Z"][..],
        &["N.X", "N.Y", "N.Z"],
        &["forward.u", "forward.v"],
    ] {
        assert!(
            matches!(found(names), Err(ExrError::NoColour { .. })),
            "{names:?}"
        );
    }
}

#[test]
fn one_part_can_hold_several_views() {
    let mut layer = part(
        "",
        None,
        [10, -20],
        [8, 6],
        Encoding::FAST_LOSSLESS,
        &[
            "R", "G", "B", "Z", "right.R", "right.G", "right.B", "right.Z",
        ]
        .map(|name| (name, Kind::Half)),
    );
    layer.attributes.multi_view_names = Some(vec![Text::from("left"), Text::from("right")]);
    let bytes = file([layer]);
    for (view, colour, depth) in [
        (None, "R", "Z"),
        (Some("left"), "R", "Z"),
        (Some("right"), "right.R", "right.Z"),
    ] {
        let options = ExrOptions {
            view: view.map(str::to_owned),
            ..ExrOptions::default()
        };
        let loaded = decode_exr(&bytes, &options).unwrap();
        assert_eq!(loaded.channels.colour.unwrap()[0], Some(colour.into()));
        assert_eq!(loaded.channels.depth, Some(depth.into()));
        assert_eq!(loaded.view.as_deref(), view.or(Some("left")));
    }
}
