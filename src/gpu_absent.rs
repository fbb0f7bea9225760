//! Replaces the GPU backend in a build without the cargo feature `gpu`: the same names, but no adapter is ever found, and
//! all other types are uninhabited.

use std::sync::Arc;

use vrtm_core::error::Result;
use vrtm_core::grid::Grid;
use vrtm_core::grid::planes::Plane;
use vrtm_core::mesh::TileMesh;

/// An uninhabited type.
#[derive(Clone, Copy, Debug)]
enum Absent {}

pub(crate) mod adapters {
    use super::context::{Context, Options};
    use vrtm_core::error::Result;
    use vrtm_core::report::AdapterInfo;

    pub(crate) struct Adapters;

    impl Adapters {
        pub fn new() -> Adapters {
            Adapters
        }

        pub fn infos(&self) -> Vec<AdapterInfo> {
            Vec::new()
        }

        pub fn open(&self, _: usize, _: Options) -> Option<Result<Context>> {
            None
        }

        pub fn listed(&self) -> String {
            "none".to_owned()
        }
    }

    pub(crate) fn interfaces() -> String {
        "none: this build has no GPU backend".to_owned()
    }
}

pub(crate) mod context {
    use super::Absent;
    use vrtm_core::error::Result;
    use vrtm_core::report::AdapterInfo;

    #[derive(Clone, Copy, Debug, Default)]
    pub struct Options {
        pub webgpu_limits: bool,
        #[allow(dead_code)]
        pub band: Option<usize>,
    }

    #[derive(Debug)]
    pub struct Context {
        pub options: Options,
        absent: Absent,
    }

    impl Context {
        pub fn describe(&self) -> AdapterInfo {
            match self.absent {}
        }

        pub fn alive(&self) -> Result<()> {
            match self.absent {}
        }

        pub fn lose(&self) {
            match self.absent {}
        }

        pub fn reclaim(&self) {
            match self.absent {}
        }

        pub fn time_kernels(&self, _: bool) {
            match self.absent {}
        }

        pub(super) fn absent(&self) -> ! {
            match self.absent {}
        }
    }
}

pub(crate) mod external {
    use super::Displacements;
    use super::context::Context;
    use vrtm_core::error::Result;
    use vrtm_core::image::external::ExternalTexels;

    #[allow(dead_code)]
    pub(crate) enum Values {
        Delta,
        Absolute([u32; 2]),
    }

    pub(crate) fn bytes_for(context: &Context, _: &ExternalTexels) -> Result<u64> {
        context.absent()
    }

    pub(crate) fn write(
        context: &Context,
        _: Option<&Displacements>,
        _: [usize; 2],
        _: Values,
        _: &ExternalTexels,
    ) -> Result<()> {
        context.absent()
    }
}

use context::Context;

#[derive(Debug)]
pub(crate) struct Memory(Absent);

impl Memory {
    pub fn new(context: &Arc<Context>, _: &Arc<Grid>, _: &TileMesh) -> Result<Memory> {
        context.absent()
    }

    pub fn bytes_for(context: &Context, _: &Grid, _: &TileMesh) -> Result<u64> {
        context.absent()
    }

    pub fn is_for(&self, _: &Arc<Grid>) -> bool {
        match self.0 {}
    }

    pub fn absent(&self) -> ! {
        match self.0 {}
    }
}

#[derive(Debug)]
pub(crate) struct Displacements {
    pub context: Arc<Context>,
    absent: Absent,
}

impl Displacements {
    pub fn host(&self) -> Result<&[[Plane; 2]]> {
        match self.absent {}
    }
}

#[derive(Debug)]
pub(crate) struct Output(Absent);

impl Output {
    pub fn suits(context: &Context, _: [usize; 2]) -> bool {
        context.absent()
    }

    pub fn bytes_for(context: &Context, _: [usize; 2]) -> u64 {
        context.absent()
    }

    pub fn new(context: &Arc<Context>, _: [usize; 2]) -> Result<Output> {
        context.absent()
    }

    pub fn holds(&self, _: [usize; 2]) -> bool {
        match self.0 {}
    }

    pub fn invert(&self, _: &Displacements, _: [usize; 2], _: impl FnMut(usize, &[[f32; 2]])) -> Result<()> {
        match self.0 {}
    }
}
