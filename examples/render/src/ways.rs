//! The ways of drawing that are compared.

/// The source of the texture's UV.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Map {
    /// No map: the original UVs.
    None,
    /// The redirection within the tile, as rg32float, filtered by the sampler if the device can do so.
    Absolute,
    /// The redirection within the tile, interpolated by the shader.
    AbsoluteByHand,
    /// The difference from the original UV, as rg16float.
    Delta,
    /// The difference from the original UV, read through its mip levels, which is an easy mistake.
    DeltaMips,
}

#[derive(Clone, Copy, Debug)]
pub struct Way {
    pub name: &'static str,
    pub map: Map,
    /// True if a second pass looks up, once per visible pixel.
    pub deferred: bool,
    /// True if the texture is read with explicit derivatives of the UV, false if the sampler computes them.
    pub explicit: bool,
}

/// The first one has the original UVs, as the mesh is drawn without vrtm.
pub const ALL: [Way; 9] = [
    way("original", Map::None, false, false),
    way("forward", Map::Absolute, false, true),
    way("forward-implicit", Map::Absolute, false, false),
    way("forward-by-hand", Map::AbsoluteByHand, false, true),
    way("forward-delta", Map::Delta, false, true),
    way("forward-mips", Map::DeltaMips, false, true),
    way("original-deferred", Map::None, true, true),
    way("deferred", Map::Absolute, true, true),
    way("deferred-delta", Map::Delta, true, true),
];

const fn way(name: &'static str, map: Map, deferred: bool, explicit: bool) -> Way {
    Way { name, map, deferred, explicit }
}

impl Way {
    /// The way of this name, which must be one of [`ALL`].
    pub fn named(name: &str) -> Way {
        ALL.into_iter().find(|way| way.name == name).expect("a way of this name")
    }

    /// Describes in words what the way reads. `filterable` tells whether samplers filter 32-bit floats.
    pub fn reads(&self, filterable: bool) -> &'static str {
        match self.map {
            Map::None => "-",
            Map::Absolute if filterable => "within the tile, rg32float, sampler",
            Map::Absolute | Map::AbsoluteByHand => "within the tile, rg32float, by hand",
            Map::Delta => "delta, rg16float, sampler",
            Map::DeltaMips => "delta, rg16float, sampler, with mips",
        }
    }
}
