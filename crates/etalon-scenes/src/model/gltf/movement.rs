//! Skins and animations: glTF 2.0, sections 3.7.3 and 3.11.

use ::gltf::json::animation::{Interpolation as JsonInterpolation, Property};
use ::gltf::json::validation::Checked;

use super::accessor::Allowed;
use super::{GltfError, Reader, get, named};
use crate::model::animation::{Animation, Interpolation, Track, Values};
use crate::model::node::Skin;
use crate::model::parts::ModelParts;

pub(super) fn skins(reader: &mut Reader<'_>, parts: &mut ModelParts) -> Result<(), GltfError> {
    let root = reader.root;
    for (i, json) in root.skins.iter().enumerate() {
        let joints: Vec<_> = json.joints.iter().map(|joint| joint.value()).collect();
        let mut inverse_bind = match json.inverse_bind_matrices {
            Some(index) => {
                let what = format!("inverse bind matrices of skin {i}");
                reader.floats(index, &what, Allowed::Float)?
            }
            None => Vec::new(),
        };
        // There may be more than joints (section 3.7.3.1).
        inverse_bind.truncate(joints.len());
        parts.skins.push(Skin {
            name: named(json.name.as_ref()),
            joints,
            inverse_bind,
        });
    }
    Ok(())
}

pub(super) fn animations(reader: &mut Reader<'_>, parts: &mut ModelParts) -> Result<(), GltfError> {
    let root = reader.root;
    for (i, json) in root.animations.iter().enumerate() {
        let mut tracks = Vec::new();
        for (j, channel) in json.channels.iter().enumerate() {
            let place = format!("animation {i}, channel {j}");
            let sampler = get(&json.samplers, channel.sampler, "sampler", || {
                format!("the sampler of {place}")
            })?;
            let malformed =
                |property: &str| GltfError::Malformed(format!("{place} has no valid {property}"));
            let interpolation = match sampler.interpolation {
                Checked::Valid(JsonInterpolation::Step) => Interpolation::Step,
                Checked::Valid(JsonInterpolation::Linear) => Interpolation::Linear,
                Checked::Valid(JsonInterpolation::CubicSpline) => Interpolation::CubicSpline,
                Checked::Invalid => return Err(malformed("interpolation")),
            };
            let Checked::Valid(property) = channel.target.path else {
                return Err(malformed("path"));
            };
            if property == Property::MorphTargetWeights {
                continue;
            }
            let times =
                reader.floats::<1>(sampler.input, &format!("times of {place}"), Allowed::Float)?;
            let what = format!("values of {place}");
            let values = match property {
                Property::Translation => {
                    Values::Translation(reader.floats(sampler.output, &what, Allowed::Float)?)
                }
                Property::Scale => {
                    Values::Scale(reader.floats(sampler.output, &what, Allowed::Float)?)
                }
                Property::Rotation | Property::MorphTargetWeights => Values::Rotation(
                    reader.floats(sampler.output, &what, Allowed::FloatOrNormalized)?,
                ),
            };
            tracks.push(Track {
                node: channel.target.node.value(),
                times: times.into_iter().flatten().collect(),
                interpolation,
                values,
            });
        }
        parts.animations.push(Animation {
            name: named(json.name.as_ref()),
            tracks,
        });
    }
    Ok(())
}
