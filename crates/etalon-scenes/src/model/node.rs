//! Where things are.

use glam::{DMat4, DQuat, DVec3};

use etalon_effects::geometry::DrawClass;

use super::error::{Check, ModelError, Place, finite};

/// A place relative to a parent's.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Transform {
    /// `translation · rotation · scale`.
    Trs {
        /// In the parent's space.
        translation: [f32; 3],
        /// A quaternion x, y, z, w of any length but 0.
        rotation: [f32; 4],
        /// Along the node's own axes, before the rotation.
        scale: [f32; 3],
    },
    /// An affine matrix, column by column; its last row is (0, 0, 0, 1).
    Matrix([f32; 16]),
}

impl Default for Transform {
    fn default() -> Self {
        Self::Trs {
            translation: [0.0; 3],
            rotation: [0.0, 0.0, 0.0, 1.0],
            scale: [1.0; 3],
        }
    }
}

impl Transform {
    /// A translation.
    #[must_use]
    pub fn at(translation: [f32; 3]) -> Self {
        Self::Trs {
            translation,
            rotation: [0.0, 0.0, 0.0, 1.0],
            scale: [1.0; 3],
        }
    }

    /// A rotation about +Y by an angle in radians, then a translation.
    #[must_use]
    pub fn turned(translation: [f32; 3], angle: f32) -> Self {
        let (sin, cos) = (0.5 * angle).sin_cos();
        Self::Trs {
            translation,
            rotation: [0.0, sin, 0.0, cos],
            scale: [1.0; 3],
        }
    }

    /// As a matrix in f64.
    #[must_use]
    pub fn matrix(&self) -> DMat4 {
        match *self {
            Self::Trs {
                translation,
                rotation,
                scale,
            } => compose(
                DVec3::from_array(translation.map(f64::from)),
                quaternion(rotation),
                DVec3::from_array(scale.map(f64::from)),
            ),
            Self::Matrix(columns) => DMat4::from_cols_array(&columns.map(f64::from)),
        }
    }

    fn check(&self, check: &Check<'_>) -> Result<(), ModelError> {
        match *self {
            Self::Trs {
                translation,
                rotation,
                scale,
            } => {
                check.value("translation", translation, "finite", finite(&translation))?;
                check.value("scale", scale, "finite", finite(&scale))?;
                check.value("rotation", rotation, ROTATION, is_rotation(&rotation))
            }
            Self::Matrix(m) => check.value(
                "matrix",
                m,
                "finite, with (0, 0, 0, 1) as its last row",
                finite(&m) && [m[3], m[7], m[11], m[15]] == [0.0, 0.0, 0.0, 1.0],
            ),
        }
    }
}

/// What is said of quaternions that are none.
pub(super) const ROTATION: &str = "a finite quaternion longer than 0";

pub(super) fn is_rotation(q: &[f32; 4]) -> bool {
    finite(q) && q.iter().any(|&x| x != 0.0)
}

/// The unit quaternion along `q`; the identity if there is none.
pub(super) fn quaternion(q: [f32; 4]) -> DQuat {
    normalized(DQuat::from_array(q.map(f64::from)))
}

pub(super) fn normalized(q: DQuat) -> DQuat {
    let length = q.length();
    if length > 0.0 && length.is_finite() {
        q / length
    } else {
        DQuat::IDENTITY
    }
}

pub(super) fn compose(translation: DVec3, rotation: DQuat, scale: DVec3) -> DMat4 {
    DMat4::from_scale_rotation_translation(scale, rotation, translation)
}

/// A mesh with its material, at a node.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Part {
    /// Index of the model's mesh.
    pub mesh: usize,
    /// Index of the model's material.
    pub material: usize,
}

/// A place in the hierarchy, and what is there.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Node {
    /// May be empty.
    pub name: String,
    /// Index of the node it moves with.
    pub parent: Option<usize>,
    /// Where it is relative to its parent.
    pub transform: Transform,
    /// What is drawn there.
    pub parts: Vec<Part>,
    /// Index of the model's light that shines from there.
    pub light: Option<usize>,
    /// Index of the model's skin that moves the vertices of its parts.
    pub skin: Option<usize>,
    /// When its parts are drawn; `None` for [`DrawClass::Dynamic`] if it has a
    /// skin or it or an ancestor is animated, otherwise [`DrawClass::Static`].
    pub class: Option<DrawClass>,
}

impl Node {
    /// A node without parent that shows one mesh.
    #[must_use]
    pub fn with_part(name: &str, transform: Transform, mesh: usize, material: usize) -> Self {
        Self {
            name: name.into(),
            transform,
            parts: vec![Part { mesh, material }],
            ..Self::default()
        }
    }

    pub(super) fn check(&self, index: usize) -> Result<(), ModelError> {
        self.transform
            .check(&Check(&Place::new("node", index, &self.name)))
    }
}

/// Joints that move vertices: glTF 2.0, section 3.7.3. Skinned vertices are in
/// world space after `Σ weight · world(joint) · inverse_bind(joint)`; the
/// transform of the node that the skin is used at does not count.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Skin {
    /// May be empty.
    pub name: String,
    /// Indices of the model's nodes, which vertices' joints refer to.
    pub joints: Vec<usize>,
    /// For each joint the affine matrix from the mesh's space to the joint's,
    /// column by column; empty where all are the identity.
    pub inverse_bind: Vec<[f32; 16]>,
}

/// Most joints of a skin: vertices refer to them by `u16`.
pub const MAX_JOINTS: usize = 1 << 16;

impl Skin {
    pub(super) fn check(&self, index: usize, nodes: usize) -> Result<(), ModelError> {
        let place = Place::new("skin", index, &self.name);
        let check = Check(&place);
        let joints = self.joints.len();
        check.count(
            "joints",
            joints,
            format!("from 1 to {MAX_JOINTS}"),
            (1..=MAX_JOINTS).contains(&joints),
        )?;
        for (i, &joint) in self.joints.iter().enumerate() {
            check.index(format!("joint {i}"), "node", joint, nodes)?;
        }
        check.count(
            "inverse bind matrices",
            self.inverse_bind.len(),
            format!("none or {joints}, as joints"),
            self.inverse_bind.is_empty() || self.inverse_bind.len() == joints,
        )?;
        check.each(
            "inverse bind matrix",
            &self.inverse_bind,
            "finite, with (0, 0, 0, 1) as its last row",
            // Exporters write rows that are off by rounding.
            |m| {
                finite(m)
                    && [m[3], m[7], m[11]].iter().all(|x| x.abs() < 1e-5)
                    && (m[15] - 1.0).abs() < 1e-5
            },
        )
    }
}
