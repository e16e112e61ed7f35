//! Recording draws.

use ash::vk;
use etalon_core::backend::BackendError;
use etalon_core::plan::{DrawExtent, PlannedDraw, PlannedTarget, RasterStep};

use super::Run;
use crate::commands::{Attachment, Commands, Extent};
use crate::device::count;

impl Run<'_> {
    /// Draws; `first` is the number of the first draw among the plan's
    /// dispatches and draws.
    pub(super) fn raster(
        &self,
        commands: &Commands<'_>,
        first: usize,
        raster: &RasterStep,
    ) -> Result<(), BackendError> {
        let colours: Vec<Attachment<'_>> = raster
            .colours
            .iter()
            .map(|target| self.attachment(target))
            .collect::<Result<_, _>>()?;
        let depth = raster
            .depth
            .as_ref()
            .map(|target| self.attachment(target))
            .transpose()?;
        commands.begin_drawing(raster.size, &colours, depth.as_ref());
        commands.viewport(&raster.viewport, &raster.scissor);
        // What has begun must end, whatever happens.
        let result = (first..)
            .zip(&raster.draws)
            .filter(|(_, draw)| !draw.extent.is_none())
            .try_for_each(|(index, draw)| self.draw(commands, index, draw));
        commands.end_drawing();
        result
    }

    fn attachment(&self, target: &PlannedTarget) -> Result<Attachment<'_>, BackendError> {
        let image = self.image(target.resource)?;
        Ok(Attachment {
            image,
            view: image.view(target.range, vk::ImageViewType::TYPE_2D)?,
            clear: target.clear,
        })
    }

    fn draw(
        &self,
        commands: &Commands<'_>,
        index: usize,
        draw: &PlannedDraw,
    ) -> Result<(), BackendError> {
        self.bind(commands, index, &draw.bindings)?;
        for (binding, vertices) in (0..).zip(&draw.vertices) {
            commands.vertices(binding, self.buffer(vertices.buffer)?, vertices.offset);
        }
        if let Some(indices) = &draw.indices {
            commands.indices(self.buffer(indices.buffer)?, indices.offset, indices.format);
        }
        let extent = match &draw.extent {
            DrawExtent::Direct {
                elements,
                base_vertex,
                instances,
            } => Extent::Direct {
                elements: (elements.start, elements.end - elements.start),
                base_vertex: *base_vertex,
                instances: (instances.start, instances.end - instances.start),
            },
            DrawExtent::Indirect {
                buffer,
                offset,
                draws,
            } => Extent::Indirect {
                records: self.buffer(*buffer)?,
                offset: *offset,
                count: *draws,
            },
        };
        commands.draw(&extent, draw.indices.is_some());
        count(&commands.device.tally.draws, 1);
        Ok(())
    }
}
