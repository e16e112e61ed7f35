//! Who executes.

use std::fmt;
use std::str::FromStr;

use etalon_ash::{AshBackend, AshOptions, Validation};
use etalon_core::backend::{Backend, BackendError, BackendInfo, Inputs};
use etalon_core::kernel::Arithmetic;
use etalon_core::plan::Plan;
use etalon_cpu::{Checks, CpuBackend, CpuOptions, NumberType, StepFinding, StepSanitised};
use etalon_wgpu::{WgpuBackend, WgpuOptions, wgpu::Backends};

use crate::observe::{ObserveError, Store, stores, wide_stores};

/// A backend, and the numbers it computes with.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// The interpreter in `f32`: what the others are held to.
    Cpu,
    /// The interpreter in `f64`, which takes decisions of its own.
    Double,
    /// The interpreter in `f32` with an `f64` shadow, which takes the decisions of
    /// the `f32`.
    Shadow,
    /// The interpreter in fast arithmetic and `f32`, several times, each with its results
    /// moved within what WGSL allows.
    Perturbed,
    /// The interpreter in `f32`, followed by the numerical sanitiser.
    Sanitiser,
    /// wgpu on Vulkan.
    Wgpu,
    /// Vulkan.
    Ash,
}

impl Kind {
    /// All of them, in the order they are run in.
    pub const ALL: [Self; 7] = [
        Self::Cpu,
        Self::Double,
        Self::Shadow,
        Self::Sanitiser,
        Self::Perturbed,
        Self::Wgpu,
        Self::Ash,
    ];

    /// By which it is known.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Cpu => "cpu",
            Self::Double => "cpu-f64",
            Self::Shadow => "cpu-shadow",
            Self::Sanitiser => "sanitiser",
            Self::Perturbed => "perturbed",
            Self::Wgpu => "wgpu",
            Self::Ash => "ash",
        }
    }

    /// Whether it takes far longer than others.
    #[must_use]
    pub const fn is_costly(self) -> bool {
        matches!(self, Self::Sanitiser | Self::Perturbed)
    }

    /// Whether it is a device, to be held to the interpreter.
    #[must_use]
    pub const fn is_device(self) -> bool {
        matches!(self, Self::Wgpu | Self::Ash)
    }

    /// The arithmetics it is run in.
    ///
    /// Devices are compared in strict arithmetic, which admits one result, and run
    /// in the fast one as well, which is to give numbers like any other. Strict
    /// kernels round to the storage format themselves, by operations on bits, which
    /// ends a shadow: what is stored in 16 bits has one in fast arithmetic alone.
    #[must_use]
    pub const fn arithmetics(self) -> &'static [Arithmetic] {
        match self {
            Self::Cpu => &[Arithmetic::Strict],
            Self::Perturbed => &[Arithmetic::Fast],
            Self::Double | Self::Shadow | Self::Sanitiser | Self::Wgpu | Self::Ash => {
                &[Arithmetic::Strict, Arithmetic::Fast]
            }
        }
    }
}

impl fmt::Display for Kind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name())
    }
}

impl FromStr for Kind {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let known = Self::ALL.into_iter().find(|kind| kind.name() == text);
        known.ok_or_else(|| {
            let names = Self::ALL.map(Self::name).join(", ");
            format!("there is no executor `{text}`; there are {names}")
        })
    }
}

/// What is watched for beside numbers.
const CHECKS: Checks = Checks {
    uninitialised: false,
    races: false,
    ..Checks::all()
};

/// The same where the sanitiser sees births of NaN and infinities.
const CHECKS_BESIDE_SANITISER: Checks = Checks {
    non_finite: false,
    ..CHECKS
};

enum Backing {
    Interpreter(Box<CpuBackend>),
    Device(Box<dyn Backend>),
}

/// An executor on its device.
pub struct Executor {
    /// Which.
    pub kind: Kind,
    backing: Backing,
}

impl fmt::Debug for Executor {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Executor({}, {})", self.kind, self.info())
    }
}

impl Executor {
    /// Opens an executor on the first device there is for it.
    ///
    /// # Errors
    /// If there is none.
    pub fn open(kind: Kind) -> Result<Self, BackendError> {
        let interpreter = |number_type| {
            CpuBackend::new(&CpuOptions {
                number_type,
                ..CpuOptions::default()
            })
            .map(|backend| Backing::Interpreter(Box::new(backend)))
        };
        let backing = match kind {
            Kind::Cpu => CpuBackend::new(&CpuOptions {
                checks: CHECKS,
                ..CpuOptions::default()
            })
            .map(|backend| Backing::Interpreter(Box::new(backend)))?,
            Kind::Double => interpreter(NumberType::F64)?,
            Kind::Shadow => interpreter(NumberType::Shadow)?,
            Kind::Perturbed => CpuBackend::new(&CpuOptions {
                perturbs: true,
                ..CpuOptions::default()
            })
            .map(|backend| Backing::Interpreter(Box::new(backend)))?,
            Kind::Sanitiser => CpuBackend::new(&CpuOptions {
                sanitise: true,
                checks: CHECKS_BESIDE_SANITISER,
                ..CpuOptions::default()
            })
            .map(|backend| Backing::Interpreter(Box::new(backend)))?,
            Kind::Wgpu => Backing::Device(Box::new(WgpuBackend::new(&WgpuOptions {
                backends: Backends::VULKAN,
                ..WgpuOptions::default()
            })?)),
            Kind::Ash => Backing::Device(Box::new(AshBackend::new(AshOptions {
                validation: Validation::Off,
                ..AshOptions::default()
            })?)),
        };
        Ok(Self { kind, backing })
    }

    /// Who it is.
    #[must_use]
    pub fn info(&self) -> BackendInfo {
        self.backend().info()
    }

    /// What plans are made for.
    #[must_use]
    pub fn backend(&self) -> &dyn Backend {
        match &self.backing {
            Backing::Interpreter(backend) => backend.as_ref(),
            Backing::Device(backend) => backend.as_ref(),
        }
    }

    /// Forgets all histories: the next frame is the first.
    pub fn reset(&mut self) {
        match &mut self.backing {
            Backing::Interpreter(backend) => backend.reset_histories(),
            Backing::Device(backend) => backend.reset_histories(),
        }
    }

    /// Becomes another device that WGSL allows, or none; of [`Kind::Perturbed`].
    pub fn perturb(&mut self, seed: Option<u64>) {
        if let Backing::Interpreter(backend) = &mut self.backing {
            backend.set_perturbation(seed);
        }
    }

    /// What the interpreter's checks found since this was last asked.
    pub fn take_checked(&mut self) -> Vec<StepFinding> {
        match &mut self.backing {
            Backing::Interpreter(backend) => backend.take_findings().list,
            Backing::Device(_) => Vec::new(),
        }
    }

    /// What the sanitiser found since this was last asked; nothing of other executors.
    pub fn take_sanitised(&mut self) -> Vec<StepSanitised> {
        match &mut self.backing {
            Backing::Interpreter(backend) => backend.take_sanitised(),
            Backing::Device(_) => Vec::new(),
        }
    }

    /// Runs a frame, and gives what its passes wrote, in their order.
    ///
    /// # Errors
    /// If the plan cannot be run, or memory runs out.
    pub fn run(&mut self, plan: &Plan, inputs: &Inputs<'_>) -> Result<Vec<Store>, ObserveError> {
        match &mut self.backing {
            Backing::Interpreter(backend) if matches!(self.kind, Kind::Double | Kind::Shadow) => {
                Ok(wide_stores(backend.execute_wide(plan, inputs)?))
            }
            Backing::Interpreter(backend) => Ok(stores(backend.execute(plan, inputs)?)),
            Backing::Device(backend) => Ok(stores(backend.execute(plan, inputs)?)),
        }
    }
}
