//! Prints the declarations that all kernels begin with: for `benches/gpu_model`, and to check shaders on their own.

fn main() {
    print!("{}", vrtm_gpu::layout::text());
}
