// Studs and spikes on the surface: one mesh, drawn for each feature where it stands in the pose.

struct Piece {
    // Its axes and its origin: on the skin alone, and as it is carried.
    @location(3) plain_x: vec3f,
    @location(4) plain_y: vec3f,
    @location(5) plain_z: vec3f,
    @location(6) plain_origin: vec3f,
    @location(7) x: vec3f,
    @location(8) y: vec3f,
    @location(9) z: vec3f,
    @location(10) origin: vec3f,
}

struct Spot {
    @builtin(position) at: vec4f,
    @location(0) position: vec3f,
    @location(1) normal: vec3f,
    @location(2) colour: vec4f,
    @location(3) height: f32,
}

@vertex
fn carried_corner(
    @location(0) point: vec3f,
    @location(1) normal: vec3f,
    // Its colour, and how it shines.
    @location(2) colour: vec4f,
    piece: Piece,
) -> Spot {
    let plain = view.redirect == 0.0;
    let x = select(piece.x, piece.plain_x, plain);
    let y = select(piece.y, piece.plain_y, plain);
    let z = select(piece.z, piece.plain_z, plain);
    let origin = select(piece.origin, piece.plain_origin, plain);
    let position = origin + point.x * x + point.y * y + point.z * z;
    // Normals go by the cofactors.
    let n = normal.x * cross(y, z) + normal.y * cross(z, x) + normal.z * cross(x, y);
    return Spot(view.clip * vec4f(position, 1.0), position, n, colour, point.z);
}

@fragment
fn carried(p: Spot) -> @location(0) vec4f {
    let toward = normalize(view.eye.xyz - p.position);
    var n = normalize(p.normal);
    n = select(n, -n, dot(n, toward) < 0.0);
    // Little light comes to where it meets the skin.
    let open = mix(0.5, 1.0, smoothstep(-0.05, 0.4, p.height));
    return vec4f(lit(p.colour.rgb * open, p.colour.a, n, toward), 1.0);
}
