// The part shared by all ways of drawing: the camera, the mesh's corners, and their projection to the screen.

struct View {
    clip: mat4x4f,
    // Unit vectors in the space of the mesh: to the right and down on the screen, and toward the viewer.
    right: vec4f,
    down: vec4f,
    toward: vec4f,
}

@group(0) @binding(0) var<uniform> view: View;

struct Corner {
    @location(0) position: vec3f,
    @location(1) normal: vec3f,
    // UV within the tile, 0 to 1.
    @location(2) uv: vec2f,
    // The tile's layer in all textures.
    @location(3) layer: u32,
}

struct Pixel {
    @builtin(position) at: vec4f,
    @location(0) normal: vec3f,
    @location(1) uv: vec2f,
    @location(2) @interpolate(flat) layer: u32,
}

@vertex
fn corner(c: Corner) -> Pixel {
    return Pixel(view.clip * vec4f(c.position, 1.0), c.normal, c.uv, c.layer);
}
