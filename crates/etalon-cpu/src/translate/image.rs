//! Texture built-ins.

use naga::{Expression, Handle, ImageClass, SampleLevel, ScalarKind, TypeInner};

use super::{Fail, Frame, Translator};
use crate::binding::{BindingKind, ChannelKind, MULTISAMPLED, View};
use crate::ir::{Access, Arith, Class, ImageAccess, ImageQuery, Op, Probed, Sampling, Value};

impl<'a> Translator<'a> {
    fn access(&self, image: u16, sampled: bool) -> Result<ImageAccess, Fail> {
        let view = match self.binding_kind(image) {
            BindingKind::Texture { view, .. } | BindingKind::StorageTexture { view, .. } => *view,
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
            coordinates: match view {
                View::D1 if sampled => 1,
                // Loads and stores have 0 as the second coordinate.
                View::D1 | View::D2 | View::D2Array => 2,
                View::D3 | View::Cube | View::CubeArray => 3,
            },
            layered: matches!(view, View::D2Array | View::CubeArray),
            cube,
        })
    }

    /// What a resource is; its index comes from the list of bindings.
    fn binding_kind(&self, resource: u16) -> &BindingKind {
        &self.bindings[usize::from(resource)].kind
    }

    fn channel_class(&self, image: u16) -> Class {
        match self.binding_kind(image) {
            BindingKind::Texture {
                kind: ChannelKind::Sint | ChannelKind::Uint,
                ..
            } => Class::Int,
            BindingKind::StorageTexture { format, .. }
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

    /// Whether texels that are written are 16-bit floats.
    fn is_half(&self, image: u16) -> bool {
        use etalon_core::Format as F;
        matches!(
            self.binding_kind(image),
            BindingKind::StorageTexture {
                format: F::R16Float | F::Rg16Float | F::Rgba16Float,
                ..
            }
        )
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
        let one_dimensional = matches!(
            *self.binding_kind(access.image),
            BindingKind::Texture { view: View::D1, .. }
                | BindingKind::StorageTexture { view: View::D1, .. }
        );
        if one_dimensional && access.coordinates == 2 {
            operands.push(self.builder.int(0));
        }
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
        let mut channels = self.scalars(frame, value)?;
        if self.builder.instrument.perturbs && class == Class::Float && self.is_half(image) {
            for channel in &mut channels {
                *channel = self.builder.perturb_store(*channel);
            }
        }
        operands.extend(&channels);
        self.where_alive(|this| {
            if this.builder.instrument.probes {
                this.builder.probe(Probed::Texel(access), &channels);
            }
            this.builder
                .op(Op::ImageStore { access, class }, &operands, &[]);
        });
        Ok(())
    }

    /// Read-modify-write of a texel.
    pub(super) fn image_atomic(
        &mut self,
        frame: &mut Frame<'a>,
        image: Handle<Expression>,
        coordinate: Handle<Expression>,
        layer: Option<Handle<Expression>>,
        function: naga::AtomicFunction,
        value: Handle<Expression>,
    ) -> Result<(), Fail> {
        let signed = self.kind(frame, value)? == ScalarKind::Sint;
        let function = super::statement::atomic_function(function, signed);
        let image = self.resource(frame, image)?;
        let access = self.access(image, false)?;
        if self.channel_class(image) != Class::Int {
            return Err(Fail::unsupported(
                "atomic operations on textures of other than integers",
            ));
        }
        let mut operands = self.coordinates(frame, access, coordinate, layer)?;
        let signed = self.kind(frame, coordinate)? == ScalarKind::Sint;
        self.check_texel(
            access,
            false,
            signed,
            Access::Atomic { reads: true },
            &operands,
        );
        operands.push(self.scalar(frame, value)?);
        self.where_alive(|this| {
            this.builder
                .op(Op::ImageAtomic { access, function }, &operands, &[]);
        });
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
        let channels = self.channels(frame, image);
        let image = self.resource(frame, image)?;
        let sampler = self.resource(frame, sampler)?;
        let access = self.access(image, true)?;
        let offset = self.texel_offset(frame, access, offset)?;
        let mut operands = self.coordinates(frame, access, coordinate, array_index)?;
        let place = operands.clone();
        self.check_layer(access, &place);
        if let Some(reference) = depth_ref {
            operands.push(self.scalar(frame, reference)?);
        }
        if let Some(channel) = gather {
            let class = self.channel_class(image);
            if offset == [0; 3] {
                let zero = self.builder.float(0.0);
                self.check_sample(access, sampler, &place, zero);
            }
            return Ok(self.builder.op(
                Op::ImageGather {
                    access,
                    sampler,
                    channel: channel as u8,
                    offset: [offset[0], offset[1]],
                    compare: depth_ref.is_some(),
                    class,
                },
                &operands,
                &[class; 4],
            ));
        }
        let (mut gradient, mut bias) = (false, None);
        match level {
            SampleLevel::Zero => operands.push(self.builder.float(0.0)),
            // Depth textures take an integer.
            SampleLevel::Exact(level) => {
                let kind = self.kind(frame, level)?;
                let value = self.scalar(frame, level)?;
                operands.push(match kind {
                    ScalarKind::Float => value,
                    ScalarKind::Uint => self.builder.arith(Arith::UToF, &[value]),
                    _ => self.builder.arith(Arith::SToF, &[value]),
                });
            }
            SampleLevel::Gradient { x, y } => {
                gradient = true;
                for derivative in [x, y] {
                    let values = self.scalars(frame, derivative)?;
                    if values.len() != usize::from(access.coordinates) {
                        return Err(Fail::invalid("derivatives of another dimension"));
                    }
                    operands.extend(values);
                }
            }
            SampleLevel::Auto | SampleLevel::Bias(_) if self.stage.is_fragment() => {
                gradient = true;
                if let SampleLevel::Bias(expression) = level {
                    bias = Some(self.scalar(frame, expression)?);
                }
                // One level for a quad, of its upper left differences: one of the
                // ways that Vulkan 1.3 (§16.5.3) leaves open, and lavapipe's.
                let coordinates = &place[..usize::from(access.coordinates)];
                for down in [false, true] {
                    for &coordinate in coordinates {
                        operands.push(self.difference(coordinate, down, true));
                    }
                }
                operands.extend(bias);
            }
            SampleLevel::Auto | SampleLevel::Bias(_) => {
                return Err(Fail::unsupported(
                    "implicit levels of detail, which take derivatives across fragments \
                     (use textureSampleLevel)",
                ));
            }
        }
        if let Some(&lod) = operands.last()
            && !gradient
            && !clamp_to_edge
            && offset == [0; 3]
        {
            self.check_sample(access, sampler, &place, lod);
        }
        let mut values = self.builder.op(
            Op::ImageSample {
                access,
                sampler,
                sampling: Sampling {
                    offset,
                    compare: depth_ref.is_some(),
                    gradient,
                    bias: bias.is_some(),
                    clamp: clamp_to_edge,
                },
            },
            &operands,
            &[Class::Float; 4],
        );
        // A comparison gives one number, as a depth texture does.
        values.truncate(channels);
        Ok(values)
    }

    /// The constant offset of a filtered read, in texels.
    fn texel_offset(
        &mut self,
        frame: &mut Frame<'a>,
        access: ImageAccess,
        offset: Option<Handle<Expression>>,
    ) -> Result<[i8; 3], Fail> {
        let mut texels = [0; 3];
        let Some(offset) = offset else {
            return Ok(texels);
        };
        if access.cube {
            return Err(Fail::invalid("a texel offset into a cube"));
        }
        let values = self.scalars(frame, offset)?;
        for (texel, value) in texels.iter_mut().zip(values) {
            let bits = self
                .builder
                .constant_bits(value)
                .ok_or_else(|| Fail::invalid("a texel offset is not constant"))?;
            // WGSL, textureSampleLevel: each component is in [-8, 7].
            *texel = i8::try_from(bits as i32)
                .ok()
                .filter(|texel| (-8..8).contains(texel))
                .ok_or_else(|| {
                    Fail::invalid(format!(
                        "a texel offset of {} is outside of -8 to 7",
                        bits as i32
                    ))
                })?;
        }
        Ok(texels)
    }

    pub(super) fn image_query(
        &mut self,
        frame: &mut Frame<'a>,
        image: Handle<Expression>,
        query: naga::ImageQuery,
    ) -> Result<Vec<Value>, Fail> {
        let axes = match *self.ty(frame, image) {
            TypeInner::Image { dim, .. } => match dim {
                naga::ImageDimension::D1 => 1,
                naga::ImageDimension::D2 | naga::ImageDimension::Cube => 2,
                naga::ImageDimension::D3 => 3,
            },
            _ => return Err(Fail::invalid("something other than a texture is queried")),
        };
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
                (0..axes)
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
            naga::ImageQuery::NumSamples => return Err(Fail::unsupported(MULTISAMPLED)),
        })
    }
}
