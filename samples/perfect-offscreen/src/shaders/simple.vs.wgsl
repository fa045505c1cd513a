@vertex
fn to_film(@location(0) p: vec3f, @location(1) n: vec3f) -> Point {
    return Point(globals.to_clip * vec4f(p, 1.0), p, n);
}

@fragment
fn distance_to_light(point: Point) -> @location(0) vec4f {
    return vec4f(distance(point.p, globals.light.xyz), 0.0, 0.0, 1.0);
}

@fragment
fn emit(point: Point) -> @location(0) vec4f {
    return vec4f(1.0);
}
