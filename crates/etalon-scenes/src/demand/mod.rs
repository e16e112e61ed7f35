//! What scenes call for: their [`Demands`](etalon_effects::demand::Demands).
//!
//! * of images, by looking at every texel: [`Frame::demands`](crate::Frame::demands);
//! * of models, by the bounds of their parts on the screen and what they are made of,
//!   before anything is drawn: [`Shot::demands`](crate::model::Shot::demands).
//!
//! Both say at least what there is. Images say just that; a model says more, since its
//! parts hide each other and fill their bounds only in part.

mod images;
mod light;
mod model;
mod projected;

/// Light up to this is not looked for: it is where bloom begins by default.
const DIM: f32 = 0.5;
