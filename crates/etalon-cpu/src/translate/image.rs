//! Texture built-ins.

use naga::{Expression, Handle, ImageClass, SampleLevel, TypeInner};

use super::{Fail, Frame, Translator};
use crate::binding::{BindingKind, ChannelKind, View};
use crate::ir::{Access, Class, ImageAccess, ImageQuery, Op, Value};

impl<'a> Translator<'a> {
    fn access(&self, image: u16, sampled: bool) -> Result<ImageAccess, Fail> {
        let view = match self
            .bindings
            .get(usize::from(image))
            .map(|binding| binding.kind)
        {
            Some(BindingKind::Texture { view, .. } | BindingKind::StorageTexture { view, .. }) => {
                view
            }
            _ => {
                return Err(Fail::invalid(
                    "something other than a texture is read as one",
                ));
            }
        };
        let cube = matches!(view, View::Cube | View::CubeArray);
        if cube && !sampled {
            return Err(Fail::invalid("texels of a cube are loaded"));
        }
        Ok(ImageAccess {
            image,
            coordinates: if matches!(view, View::D2 | View::D2Array) {
                2
            } else {
                3
            },
            layered: matches!(view, View::D2Array | View::CubeArray),
            cube,
        })
    }

    fn channel_class(&self, image: u16) -> Class {
        match self
            .bindings
            .get(usize::from(image))
            .map(|binding| binding.kind)
        {
            Some(BindingKind::Texture {
                kind: ChannelKind::Sint | ChannelKind::Uint,
                ..
            }) => Class::Int,
            Some(BindingKind::StorageTexture { format, .. })
                if matches!(
                    format.sample_kind(),
                    etalon_core::format::SampleKind::Sint | etalon_core::format::SampleKind::Uint
                ) =>
            {
                Class::Int
            }
            _ => Class::Float,
        }
    }

    /// Depth textures are read as one number, all others as four.
    fn channels(&self, frame: &Frame<'a>, image: Handle<Expression>) -> usize {
        match *self.ty(frame, image) {
            TypeInner::Image {
                class: ImageClass::Depth { .. },
                ..
            } => 1,
            _ => 4,
        }
    }

    /// Coordinates and layer, in that order.
    fn coordinates(
        &mut self,
        frame: &mut Frame<'a>,
        access: ImageAccess,
        coordinate: Handle<Expression>,
        layer: Option<Handle<Expression>>,
    ) -> Result<Vec<Value>, Fail> {
        let mut operands = self.scalars(frame, coordinate)?;
        if let Some(layer) = layer {
            operands.push(self.scalar(frame, layer)?);
        }
        if operands.len() != usize::from(access.coordinates) + usize::from(access.layered) {
            return Err(Fail::invalid(
                "a texture has coordinates of another dimension",
            ));
        }
        Ok(operands)
    }

    pub(super) fn image_load(
        &mut self,
        frame: &mut Frame<'a>,
        image: Handle<Expression>,
        coordinate: Handle<Expression>,
        layer: Option<Handle<Expression>>,
        level: Option<Handle<Expression>>,
    ) -> Result<Vec<Value>, Fail> {
        let channels = self.channels(frame, image);
        let image = self.resource(frame, image)?;
        let access = self.access(image, false)?;
        let class = self.channel_class(image);
        let mut operands = self.coordinates(frame, access, coordinate, layer)?;
        if let Some(level) = level {
            operands.push(self.scalar(frame, level)?);
        }
        let signed = self.kind(frame, coordinate)? == naga::ScalarKind::Sint;
        self.check_texel(access, level.is_some(), signed, Access::Read, &operands);
        let mut values = self.builder.op(
            Op::ImageLoad {
                access,
                class,
                level: level.is_some(),
            },
            &operands,
            &[class; 4],
        );
        values.truncate(channels);
        Ok(values)
    }

    pub(super) fn image_store(
        &mut self,
        frame: &mut Frame<'a>,
        image: Handle<Expression>,
        coordinate: Handle<Expression>,
        layer: Option<Handle<Expression>>,
        value: Handle<Expression>,
    ) -> Result<(), Fail> {
        let image = self.resource(frame, image)?;
        let access = self.access(image, false)?;
        let class = self.channel_class(image);
        let mut operands = self.coordinates(frame, access, coordinate, layer)?;
        let signed = self.kind(frame, coordinate)? == naga::ScalarKind::Sint;
        self.check_texel(access, false, signed, Access::Write, &operands);
        operands.extend(self.scalars(frame, value)?);
        self.builder
            .op(Op::ImageStore { access, class }, &operands, &[]);
        Ok(())
    }

    pub(super) fn image_sample(
        &mut self,
        frame: &mut Frame<'a>,
        expression: Handle<Expression>,
    ) -> Result<Vec<Value>, Fail> {
        let Expression::ImageSample {
            image,
            sampler,
            gather,
            coordinate,
            array_index,
            offset,
            level,
            depth_ref,
            clamp_to_edge,
        } = frame.function.expressions[expression]
        else {
            return Err(Fail::invalid("not a sampling expression"));
        };
        let refused = [
            (gather.is_some(), "textureGather"),
            (depth_ref.is_some(), "comparison sampling"),
            (offset.is_some(), "texel offsets of samples"),
            (clamp_to_edge, "textureSampleBaseClampToEdge"),
            (
                matches!(level, SampleLevel::Auto | SampleLevel::Bias(_)),
                "implicit levels of detail (use textureSampleLevel)",
            ),
            (
                matches!(level, SampleLevel::Gradient { .. }),
                "textureSampleGrad",
            ),
        ];
        if let Some((_, construct)) = refused.iter().find(|(is, _)| *is) {
            return Err(Fail::unsupported(*construct));
        }
        let channels = self.channels(frame, image);
        let is_depth = channels == 1;
        let image = self.resource(frame, image)?;
        let sampler = self.resource(frame, sampler)?;
        let access = self.access(image, true)?;
        let mut operands = self.coordinates(frame, access, coordinate, array_index)?;
        operands.push(match level {
            // Depth textures take an integer.
            SampleLevel::Exact(level)
                if is_depth && self.kind(frame, level)? != naga::ScalarKind::Float =>
            {
                let level = self.scalar(frame, level)?;
                self.builder.arith(crate::ir::Arith::SToF, &[level])
            }
            SampleLevel::Exact(level) => self.scalar(frame, level)?,
            _ => self.builder.float(0.0),
        });
        self.check_sample(access, sampler, &operands);
        let mut values = self.builder.op(
            Op::ImageSample { access, sampler },
            &operands,
            &[Class::Float; 4],
        );
        values.truncate(channels);
        Ok(values)
    }

    pub(super) fn image_query(
        &mut self,
        frame: &mut Frame<'a>,
        image: Handle<Expression>,
        query: naga::ImageQuery,
    ) -> Result<Vec<Value>, Fail> {
        let (three, cube) = match *self.ty(frame, image) {
            TypeInner::Image { dim, .. } => (
                dim == naga::ImageDimension::D3,
                dim == naga::ImageDimension::Cube,
            ),
            _ => return Err(Fail::invalid("something other than a texture is queried")),
        };
        let _ = cube;
        let image = self.resource(frame, image)?;
        let mut ask = |query, operands: &[Value]| {
            self.builder
                .op(Op::ImageQuery { image, query }, operands, &[Class::Int])[0]
        };
        Ok(match query {
            naga::ImageQuery::Size { level } => {
                let level = match level {
                    Some(level) => self.scalar(frame, level)?,
                    None => self.builder.int(0),
                };
                self.check_level(image, level);
                (0..if three { 3 } else { 2 })
                    .map(|axis| {
                        self.builder.op(
                            Op::ImageQuery {
                                image,
                                query: ImageQuery::Size(axis),
                            },
                            &[level],
                            &[Class::Int],
                        )[0]
                    })
                    .collect()
            }
            naga::ImageQuery::NumLevels => vec![ask(ImageQuery::Levels, &[])],
            naga::ImageQuery::NumLayers => vec![ask(ImageQuery::Layers, &[])],
            naga::ImageQuery::NumSamples => return Err(Fail::unsupported("multisampled textures")),
        })
    }
}
