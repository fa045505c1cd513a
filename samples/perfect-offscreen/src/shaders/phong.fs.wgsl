@fragment
fn reflect_phong(point: Point) -> @location(0) vec4f {
    let n = normalize(point.n);
    let light = light(point.p, n);
    let exponent = surface.kd.w;
    let lobe = pow(max(dot(reflect(-light.wo, n), light.wi), 0.0), exponent);
    let f = 0.318309886 * (surface.kd.rgb + 0.5 * (exponent + 2.0) * lobe * surface.ks.rgb);
    return vec4f(f * light.irradiance, 1.0);
}
