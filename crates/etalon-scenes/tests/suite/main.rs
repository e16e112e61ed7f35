//! Scenes, files of images and models, and the ray caster.

mod common;
mod environment_files;
mod exr;
mod frames;
mod geometry;
mod gltf;
mod model_shapes;
mod models;
mod reflections;
mod registry;
mod scene_queries;
mod triangles;
mod truth;
