@fragment
fn reflect_diffuse(point: Point) -> @location(0) vec4f {
    let n = normalize(point.n);
    return vec4f(0.318309886 * surface.kd.rgb * light(point.p, n).irradiance, 1.0);
}
