//! Any mesh that a host may hand over: it is refused with a message, or becomes an asset that solves and is certified.

use std::ptr;
use std::sync::LazyLock;

use super::{Array, Input, array, check, device, nowhere, options, sized, small_grids};
use vrtm_capi::{
    asset::*, fetch::*, handle::*, mesh::*, refine::*, report::*, solve::*, status::*, tile::*, types::*,
};

static DEVICE: LazyLock<vrtm_device> = LazyLock::new(|| device(1));

/// One input.
pub fn run(bytes: &[u8]) {
    let mut input = Input::new(bytes);
    let vertices = input.below(24);
    let positions = array(&mut input, vertices, 3);
    let faces = Faces::new(&mut input, vertices);
    let sets: Vec<Uvs> =
        (0..1 + input.odd(0, &[1, 2])).map(|_| Uvs::new(&mut input, &faces.indices)).collect();
    let indices = |input: &mut Input, below: usize| -> Vec<u32> {
        let count = 2 * input.below(5);
        (0..count).map(|_| index(input, below)).collect()
    };
    let (seams, textured) = (indices(&mut input, vertices), indices(&mut input, faces.counts.len()));

    let mut later = Later { mesh: vrtm_mesh_desc::default(), more: [0, input.odd(0, &[1])] };
    let mesh = &mut later.mesh;
    mesh.struct_size =
        input.odd(mesh.struct_size, &[0, 8, mesh.struct_size + 8, mesh.struct_size + 16, 5000]);
    mesh.positions = input.odd(&raw const positions.c, &[ptr::null()]);
    (mesh.indices, mesh.index_count) = list(&mut input, &faces.indices);
    match input.below(4) {
        0 => {}
        1 => (mesh.face_offsets, mesh.face_offset_count) = list(&mut input, &faces.offsets),
        _ => (mesh.face_counts, mesh.face_count) = list(&mut input, &faces.counts),
    }
    let first = sets[0].describe(&mut input);
    (mesh.uvs, mesh.u, mesh.v) = (first.uvs, first.u, first.v);
    (mesh.uv_indices, mesh.uv_index_count) = (first.uv_indices, first.uv_index_count);
    let others: Vec<vrtm_uv_set> = sets[1..].iter().map(|set| set.describe(&mut input)).collect();
    if !others.is_empty() {
        (mesh.uv_sets, mesh.uv_set_count) = (others.as_ptr(), others.len());
    }
    if input.below(4) == 3 {
        (mesh.seams, mesh.seam_count) = list(&mut input, &seams);
        mesh.seam_count /= 2;
    }
    if input.below(4) == 3 {
        (mesh.textured_faces, mesh.textured_face_count) = list(&mut input, &textured);
    }
    mesh.weld = input.odd(input_weld(vertices), &[VRTM_WELD_INDEX, VRTM_WELD_POSITION, VRTM_WELD_OFF, -1, 3]);
    mesh.weld_position_tolerance = input.odd(0.0, &[1e-30, 0.1, 1.0, -1.0, f64::NAN]);
    mesh.weld_uv_tolerance = input.odd(0.0, &[1e-30, 0.1, 1.0, -1.0, f64::NAN]);

    // To turn an input that fails into a test.
    if std::env::var_os("VRTM_FUZZ_SHOW").is_some() {
        println!("positions {:?} {faces:?}", positions.values());
        println!("counts {:?} {}", mesh.face_counts, mesh.face_count);
        println!("offsets {:?} {}", mesh.face_offsets, mesh.face_offset_count);
        println!(
            "seams {:?} of {seams:?}, textured {:?} of {textured:?}",
            mesh.seam_count, mesh.textured_face_count
        );
        println!("weld {} {} {}", mesh.weld, mesh.weld_position_tolerance, mesh.weld_uv_tolerance);
        for set in &sets {
            println!("uvs {:?} {:?} {:?}", set.pairs.values(), set.u.values(), set.v.values());
            println!("{} {:?}", if set.indexed { "by" } else { "not by" }, set.indices);
        }
    }
    let mut asset = vrtm_asset { id: 77 };
    // SAFETY: all pointers are null or point to memory of the claimed size; those to nowhere claim more than there can be.
    unsafe {
        let made = check(vrtm_asset_create(*DEVICE, (&raw const later).cast(), &mut asset));
        assert_eq!(made, asset.id != 77);
        if made {
            solve(&mut input, asset, vertices, faces.indices.len());
            assert!(check(vrtm_asset_destroy(asset)));
        }
    }
}

/// As a later header has the struct.
#[repr(C)]
struct Later {
    mesh: vrtm_mesh_desc,
    more: [u64; 2],
}

fn input_weld(vertices: usize) -> vrtm_weld {
    [VRTM_WELD_INDEX, VRTM_WELD_POSITION][vertices % 2]
}

/// Mostly less than `below`.
fn index(input: &mut Input, below: usize) -> u32 {
    let good = input.below(below.max(1)) as u32;
    match input.below(64) {
        63 => input.pick(&[below as u32, u32::MAX, u32::MAX - 1]),
        _ => good,
    }
}

/// A list as C takes it: mostly all of it, or less, or none.
fn list(input: &mut Input, from: &[u32]) -> (*const u32, usize) {
    match input.below(40) {
        36 => (ptr::null(), from.len()),
        37 => (from.as_ptr(), from.len().saturating_sub(1)),
        38 => (from.as_ptr(), 0),
        39 => (nowhere().cast(), input.pick(&[usize::MAX, usize::MAX / 2, usize::MAX / 4 + 1])),
        _ => (from.as_ptr(), from.len()),
    }
}

#[derive(Debug)]
struct Faces {
    counts: Vec<u32>,
    offsets: Vec<u32>,
    indices: Vec<u32>,
}

impl Faces {
    fn new(input: &mut Input, vertices: usize) -> Faces {
        let mut counts: Vec<u32> =
            (0..input.below(16)).map(|_| [3, 4, 3, 4, 5, 6, 2, 0][input.below(8)]).collect();
        let corners = counts.iter().sum::<u32>();
        let indices = (0..corners).map(|_| index(input, vertices)).collect();
        let mut offsets: Vec<u32> = vec![0];
        offsets.extend(counts.iter().scan(0, |sum, count| {
            *sum += count;
            Some(*sum)
        }));
        // Counts and offsets that do not add up.
        for list in [&mut counts, &mut offsets] {
            if input.below(32) == 31 && !list.is_empty() {
                let at = input.below(list.len());
                list[at] = input.pick(&[0, 1, 200, u32::MAX, u32::MAX / 2]);
            }
        }
        Faces { counts, offsets, indices }
    }
}

/// A set of UVs: as pairs, or u and v apart.
struct Uvs {
    pairs: Array,
    u: Array,
    v: Array,
    indices: Vec<u32>,
    apart: bool,
    indexed: bool,
}

impl Uvs {
    fn new(input: &mut Input, corners: &[u32]) -> Uvs {
        let indexed = input.below(3) != 2;
        let count = if indexed { 1 + input.below(24) } else { corners.len() };
        let indices = match input.below(2) {
            // UVs follow the vertices.
            0 => corners.iter().map(|&corner| corner.min(count as u32 - u32::from(count > 0))).collect(),
            _ => corners.iter().map(|_| index(input, count)).collect(),
        };
        let apart = input.below(4) == 3;
        let of = |yes: bool| if yes { count } else { 0 };
        Uvs {
            pairs: array(input, of(!apart), 2),
            u: array(input, of(apart), 1),
            v: array(input, of(apart), 1),
            indices,
            apart,
            indexed,
        }
    }

    fn describe(&self, input: &mut Input) -> vrtm_uv_set {
        let (pairs, u, v) = (&raw const self.pairs.c, &raw const self.u.c, &raw const self.v.c);
        let none = ptr::null();
        let good = if self.apart { [none, u, v] } else { [pairs, none, none] };
        let [uvs, u, v] = input.odd(good, &[[pairs, u, v], [none, none, v], [none; 3]]);
        let (uv_indices, uv_index_count) =
            if self.indexed { list(input, &self.indices) } else { (ptr::null(), 0) };
        vrtm_uv_set { uvs, u, v, uv_indices, uv_index_count }
    }
}

/// # Safety
/// Any handle may be given.
unsafe fn solve(input: &mut Input, asset: vrtm_asset, vertices: usize, corners: usize) {
    let mut info = sized::<vrtm_asset_info>();
    let positions = array(input, vertices, 3);
    let rigidity = array(input, vertices, 1);
    let options = options(input);
    // SAFETY: all pointers point to memory of the claimed size.
    unsafe {
        assert!(check(vrtm_asset_get_info(asset, &mut info)));
        assert_eq!((info.vertices, info.corners), (vertices as u64, corners as u64));
        small_grids(asset);
        check(vrtm_asset_set_vertex_mask(asset, &rigidity.c));
        check(vrtm_asset_set_vertex_mask(asset, ptr::null()));
        check(vrtm_asset_set_vertex_rigidity(asset, &rigidity.c));
        if !check(vrtm_asset_solve(asset, &positions.c, &options)) {
            return;
        }
        let mut report = sized::<vrtm_asset_report>();
        assert!(check(vrtm_asset_get_report(asset, &mut report)));
        if options.solver == VRTM_SOLVER_DESCENT {
            assert!(report.folds == 0 && report.min_jacobian > 0.0, "{} folds", report.folds);
        }
        let mut uvs = vec![f32::NAN; 2 * corners];
        assert!(check(vrtm_asset_fetch_corner_uvs(asset, 0, uvs.as_mut_ptr(), corners)));
        assert!(uvs.iter().all(|x| x.is_finite()), "a corner's UV is not finite");
        let mut tile = vrtm_tile { id: 0 };
        if vrtm_asset_get_tile(asset, input.below(4) as u32, &mut tile) == VRTM_OK {
            let mut map = vec![f32::NAN; 2 * 9 * 5];
            let mut image = sized::<vrtm_image_out>();
            (image.width, image.height) = (9, 5);
            image.data = map.as_mut_ptr().cast();
            let kind = input.pick(&[VRTM_FETCH_REDIRECTION, VRTM_FETCH_REDIRECTION_DELTA, VRTM_FETCH_WARP]);
            let mut fetch = sized::<vrtm_fetch>();
            (fetch.kind, fetch.tile, fetch.image) = (kind, tile, &image);
            assert!(check(vrtm_asset_fetch(&fetch, 1)));
            assert!(map.iter().all(|x| x.is_finite()), "a texel is not finite");
        }
        refine(input, asset);
    }
}

/// Refines the mesh for its result, within a small limit, and reads all of it.
///
/// # Safety
/// Any handle may be given.
unsafe fn refine(input: &mut Input, asset: vrtm_asset) {
    let mut desc = sized::<vrtm_refinement_desc>();
    desc.tolerance = input.pick(&[0.0, 1e-4, 0.02, 1.0, -1.0, f64::NAN]);
    desc.max_triangles = input.pick(&[1, 300, 2000]);
    let mut refinement = vrtm_refinement { id: 0 };
    // SAFETY: all pointers point to memory of the claimed size.
    unsafe {
        if !check(vrtm_refinement_create(asset, &desc, &mut refinement)) {
            return;
        }
        if input.below(2) == 1 {
            assert!(check(vrtm_refinement_extend(refinement)));
        }
        let mut data = sized::<vrtm_refinement_info>();
        assert!(check(vrtm_refinement_get_info(refinement, &mut data)));
        let (vertices, corners) = (data.vertices as usize, data.corners as usize);
        let mut uvs = vec![f32::NAN; 2 * corners];
        assert!(check(vrtm_refinement_fetch_corner_uvs(refinement, uvs.as_mut_ptr(), corners)));
        assert!(uvs.iter().all(|x| x.is_finite()), "a corner's UV is not finite");
        let mut weights = vec![f32::NAN; 3 * vertices];
        let mut owners = vec![u32::MAX; corners];
        let mut pattern = sized::<vrtm_refinement_pattern>();
        (pattern.vertex_count, pattern.corner_count) = (vertices, corners);
        pattern.face_count = data.faces as usize;
        pattern.vertex_weights = weights.as_mut_ptr();
        pattern.corner_vertices = owners.as_mut_ptr();
        assert!(check(vrtm_refinement_fetch_pattern(refinement, &pattern)));
        assert!(owners.iter().all(|&v| (v as usize) < vertices), "a corner's vertex is not there");
        for three in weights.chunks_exact(3) {
            assert!((three.iter().sum::<f32>() - 1.0).abs() < 1e-5, "weights add up to {three:?}");
        }
        assert!(check(vrtm_refinement_destroy(refinement)));
    }
}
