//! Plans in an engine's frame: its device, its textures, its command buffers.

use ash::vk;
use etalon_core::backend::{Backend, BackendError};
use etalon_core::plan::{Plan, ResourceKind, Step, Usage};

use crate::backend::{AshBackend, AshOptions, run};
use crate::bindings::{AshBindings, Given};
use crate::buffer::Buffer;
use crate::commands::{Barriers, Commands};
use crate::device::{AdoptedDevice, Device};
use crate::engine::{AdoptedBuffer, AdoptedTexture, AshBuffer, AshOutputs, AshTexture};
use crate::error::unsupported;
use crate::handover;
use crate::image::{self, Image};

impl AshBackend {
    /// A backend on an engine's device. It makes objects and allocates memory
    /// there, and destroys what it has made, nothing else.
    ///
    /// # Errors
    /// [`BackendError::NoDevice`] if the device lacks something, by name.
    ///
    /// # Safety
    /// * The handles are valid, belong together, and outlive the backend and
    ///   everything made with it.
    /// * The features stated are enabled; if `debug_utils` is set, so is that
    ///   extension.
    /// * The promise of [`AshOptions::frames_in_flight`] is kept.
    /// * When the backend is dropped, and when an [`AshTexture`] or
    ///   [`AshBuffer`] is dropped after it, everything recorded with it has
    ///   left the GPU.
    /// * During [`Backend::execute`], which submits and waits, nobody else uses
    ///   the queue.
    pub unsafe fn adopt(adopted: AdoptedDevice, options: AshOptions) -> Result<Self, BackendError> {
        Ok(Self::with(Device::adopt(adopted)?, options))
    }

    /// Makes an engine's image known, for [`AshBindings`].
    ///
    /// # Errors
    /// [`BackendError::InputMismatch`] for a description that no image of the
    /// device can have.
    ///
    /// # Safety
    /// The image is of the backend's device, is as described, and lives as long
    /// as the texture. Recordings that were given the texture have left the GPU
    /// before it is destroyed.
    pub unsafe fn adopt_texture(
        &self,
        adopted: AdoptedTexture,
    ) -> Result<AshTexture, BackendError> {
        let AdoptedTexture { image, desc, usage } = adopted;
        image::check(&self.device, &desc, usage).map_err(|given| BackendError::InputMismatch {
            name: format!("{image:?}"),
            given,
            wanted: "an image that this device can have".to_owned(),
        })?;
        Ok(AshTexture {
            image: Image::adopted(&self.device, image, &desc, usage),
            device: self.device.clone(),
        })
    }

    /// Makes part of an engine's buffer known, for [`AshBindings`].
    ///
    /// # Errors
    /// [`BackendError::InputMismatch`] for a part that is empty, too large or
    /// not aligned.
    ///
    /// # Safety
    /// The buffer is of the backend's device, was made for these usages, has
    /// the bytes, and lives as long as the result. Recordings that were given
    /// it have left the GPU before it is destroyed.
    pub unsafe fn adopt_buffer(&self, adopted: AdoptedBuffer) -> Result<AshBuffer, BackendError> {
        let AdoptedBuffer {
            buffer,
            offset,
            bytes,
            usage,
        } = adopted;
        let limits = &self.device.physical.limits;
        let alignment = limits.min_storage_buffer_offset_alignment.max(4);
        let most = self.limits().max_buffer_bytes;
        if bytes == 0
            || !bytes.is_multiple_of(4)
            || bytes > most
            || !offset.is_multiple_of(alignment)
            || offset.checked_add(bytes).is_none()
        {
            return Err(BackendError::InputMismatch {
                name: format!("{buffer:?}"),
                given: format!("{bytes} bytes at byte {offset}"),
                wanted: format!("a multiple of 4 bytes up to {most}, at a multiple of {alignment}"),
            });
        }
        Ok(AshBuffer {
            buffer: Buffer::adopted(&self.device, buffer, offset, bytes, usage),
            device: self.device.clone(),
        })
    }

    /// Records a plan into an engine's command buffer.
    ///
    /// Histories advance with each recording, so every one is to be submitted,
    /// in the order of recording and to the queue that was adopted. A plan with
    /// captures is refused: there is nobody to wait for them.
    ///
    /// # Errors
    /// Wrong bindings and plans that the device cannot run, before anything is
    /// made or recorded. After any other error the command buffer may hold part
    /// of the commands; it is to be discarded.
    ///
    /// # Safety
    /// * The command buffer was allocated from the backend's device, for the
    ///   adopted queue's family, and is in the recording state outside a render
    ///   pass.
    /// * Textures and buffers are in the states they are said to be in when
    ///   the commands run.
    /// * The conditions of [`AshBackend::adopt`] hold.
    pub unsafe fn record(
        &mut self,
        command_buffer: vk::CommandBuffer,
        plan: &Plan,
        bindings: &AshBindings<'_>,
    ) -> Result<AshOutputs, BackendError> {
        if let Some(step) = plan
            .steps
            .iter()
            .find(|step| matches!(step.step, Step::Capture { .. }))
        {
            return Err(unsupported(
                &step.name,
                "a host that waits for it (plan with `Capture::None` for an engine's frame)",
            ));
        }
        let given = self.given(plan, bindings)?;
        let prepared = self.prepare(plan)?;
        let pairs = self.histories.get(&self.device, plan)?;
        let resources =
            self.resources(
                plan,
                prepared,
                &pairs,
                |prepared, device, index| match given.get(index).and_then(Option::as_ref) {
                    Some(Given {
                        resource: Some(resource),
                        ..
                    }) => Ok(resource.clone()),
                    _ => prepared.output(device, index, &plan.resources[index]),
                },
            )?;
        let recording = self.begin_engine_recording();
        // SAFETY: this function's own conditions.
        let commands = unsafe { Commands::new(&self.device, command_buffer) };
        let prepared = &mut self.prepared[prepared].1;

        let mut before = Barriers::default();
        let mut after = Barriers::default();
        let mut outputs = AshOutputs::default();
        let all = resources.iter().zip(&plan.resources).zip(&given);
        for (((resource, planned), given), left) in all.zip(&mut prepared.left) {
            let Some(given) = given else { continue };
            if let Some(returns) = given.returns {
                handover::leave(&mut after, resource, returns);
            }
            if let ResourceKind::Output(names) = &planned.kind {
                // The backend's own was left somewhere by the run before.
                let before_run = if given.resource.is_some() {
                    given.arrives
                } else {
                    std::mem::replace(left, given.returns)
                };
                if let Some(state) = before_run {
                    handover::wait(&mut before, resource, state);
                }
                let returns = given.returns.unwrap_or_else(|| handover::rest(resource));
                outputs.add(names, resource, returns)?;
            } else if let Some(arrives) = given.arrives {
                handover::arrive(&mut before, resource, arrives);
            }
        }
        commands.begin_label("etalon");
        commands.barrier(&mut before);
        let result = run(
            &self.device,
            &commands,
            prepared,
            &self.shared,
            plan,
            &resources,
            &pairs,
            recording,
            false,
        );
        commands.barrier(&mut after);
        commands.end_label();
        result?;
        self.histories.advance(plan);
        Ok(outputs)
    }

    /// What an engine gives for each resource of a plan; `None` for what it
    /// does not give.
    fn given(
        &self,
        plan: &Plan,
        bindings: &AshBindings<'_>,
    ) -> Result<Vec<Option<Given>>, BackendError> {
        let mut given = Vec::with_capacity(plan.resources.len());
        // Identities of what is written, and of all, with their names.
        let mut written: Vec<u64> = Vec::new();
        let mut all: Vec<(u64, &str)> = Vec::new();
        for planned in &plan.resources {
            let found = match &planned.kind {
                ResourceKind::Import(name) => Some(bindings.import(&self.device, name, planned)?),
                ResourceKind::Output(names) => {
                    Some(bindings.output(&self.device, names, planned)?)
                }
                _ => None,
            };
            if let Some(resource) = found.as_ref().and_then(|found| found.resource.as_ref()) {
                all.push((resource.id(), &planned.name));
                if planned.usages.iter().any(Usage::writes) {
                    written.push(resource.id());
                }
            }
            given.push(found);
        }
        for id in written {
            let mut same = all.iter().filter(|(other, _)| *other == id);
            if let (Some((_, first)), Some((_, second))) = (same.next(), same.next()) {
                return Err(BackendError::InputMismatch {
                    name: (*second).to_owned(),
                    given: format!("what is also given as `{first}`"),
                    wanted: "something else, since one of them is written".to_owned(),
                });
            }
        }
        Ok(given)
    }

    /// Begins a recording of an engine's, by which an older one is done.
    fn begin_engine_recording(&mut self) -> u64 {
        let recording = self.device.begin_recording();
        self.under_way.push_back(recording);
        let most = usize::try_from(self.options.frames_in_flight).unwrap_or(usize::MAX);
        while self.under_way.len() > most {
            if let Some(done) = self.under_way.pop_front() {
                self.device.complete(done);
            }
        }
        recording
    }
}
