//! What the sanitiser finds in draws.

use naga::Span;

use super::{DrawCounters, RasterDraw, RasterProgram, StageProgram};
use crate::error::Location;
use crate::exec::{Heat, StageWatch};
use crate::sanitise::{Probes, Sanitised};

/// What a draw did, and what the sanitiser found in it.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct DrawReport {
    /// How much was drawn.
    pub counters: DrawCounters,
    /// Nothing unless [`RasterDesc::sanitise`](super::RasterDesc::sanitise) was set.
    pub sanitised: DrawSanitised,
}

/// What the sanitiser found in the kernels of draws.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct DrawSanitised {
    /// In the vertex kernel, without maps.
    pub vertices: Sanitised,
    /// In the fragment kernel: its invocations are pixels, each as often as it was
    /// shaded.
    pub fragments: Sanitised,
}

/// What the probes of a program note, of some draws to targets of one size.
#[derive(Debug, Default)]
pub(crate) struct DrawWatch {
    pub(super) vertices: StageWatch,
    pub(super) fragments: StageWatch,
    size: [u32; 2],
}

impl RasterProgram {
    /// Nothing noted yet of draws like this one.
    pub(crate) fn watch(&self, draw: &RasterDraw<'_>) -> DrawWatch {
        let view = draw.colours.first().or(draw.depth);
        let size = view.map_or([0; 2], |view| {
            let extent = view.desc().extent;
            [extent.width, extent.height]
        });
        let pixels = u64::from(size[0]) * u64::from(size[1]);
        let heat = |stage: &StageProgram| self.probes(stage).heat(pixels);
        DrawWatch {
            vertices: StageWatch::new(Heat::default()),
            fragments: StageWatch::new(self.fragment.as_ref().map(heat).unwrap_or_default()),
            size,
        }
    }

    /// Gives what was noted names and places.
    pub(crate) fn sanitised(&self, watch: DrawWatch) -> DrawSanitised {
        let [width, height] = watch.size;
        let (tallies, heat) = watch.vertices.into_tallies();
        let number = |at: u64| [at as u32, 0, 0];
        let vertices = self
            .probes(&self.vertex)
            .sanitised(&tallies, &heat, [0; 2], number);
        let (tallies, heat) = watch.fragments.into_tallies();
        let pixel = |at: u64| {
            let row = u64::from(width.max(1));
            // Each is below the size of a target.
            [(at % row) as u32, (at / row) as u32, 0]
        };
        let fragments = self.fragment.as_ref().map(|stage| {
            self.probes(stage)
                .sanitised(&tallies, &heat, [width, height], pixel)
        });
        DrawSanitised {
            vertices,
            fragments: fragments.unwrap_or_default(),
        }
    }

    fn probes<'a>(&'a self, stage: &'a StageProgram) -> Probes<'a> {
        let locate: &dyn Fn(Span) -> Location = &*self.locate;
        Probes {
            probes: &stage.code.resources.probes,
            bindings: &self.bindings,
            locate,
        }
    }
}
