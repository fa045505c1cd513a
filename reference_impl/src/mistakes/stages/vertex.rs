//! Mistakes of `simple.vs`.

use super::{DIFFUSE, PHONG, VS, mistakes};

const CLIP: &str = "frame.projection * frame.view * world;";
const POSITION: &str = "out.world_position = world.xyz;";
const NORMAL: &str = "out.world_normal = (object.normal_matrix * vec4f(normal, 0.0)).xyz;";
const RETURN: &str = "return out;";
const VARYING: &str = "@location(1) world_normal: vec3f,";
const FLAT: &str = "@location(1) @interpolate(flat) world_normal: vec3f,";

mistakes! {
    "vertex-normal-zero": (VS, NORMAL, "out.world_normal = vec3f(0.0);");
    "vertex-normal-is-position": (VS, NORMAL, "out.world_normal = position;");
    "vertex-normal-negated":
        (VS, NORMAL, "out.world_normal = -(object.normal_matrix * vec4f(normal, 0.0)).xyz;");
    "vertex-normal-swizzled":
        (VS, NORMAL, "out.world_normal = (object.normal_matrix * vec4f(normal, 0.0)).zyx;");
    "vertex-normal-up": (VS, NORMAL, "out.world_normal = vec3f(0.0, 1.0, 0.0);");
    "vertex-normal-view-space":
        (VS, NORMAL, "out.world_normal = (frame.view * object.normal_matrix * vec4f(normal, 0.0)).xyz;");
    "vertex-position-view-space": (VS, POSITION, "out.world_position = (frame.view * world).xyz;");
    "vertex-position-clip-space":
        (VS, POSITION, "out.world_position = (frame.projection * frame.view * world).xyz;");
    "vertex-position-halved": (VS, POSITION, "out.world_position = 0.5 * world.xyz;");
    "vertex-position-zero": (VS, POSITION, "out.world_position = vec3f(0.0);");
    "vertex-normal-flat":
        (VS, VARYING, FLAT), (DIFFUSE, VARYING, FLAT), (PHONG, VARYING, FLAT);
    "vertex-no-view": (VS, CLIP, "frame.projection * world;");
    "vertex-no-projection": (VS, CLIP, "frame.view * world;");
    "vertex-matrices-swapped": (VS, CLIP, "frame.view * frame.projection * world;");
    "vertex-flipped":
        (VS, CLIP, "vec4f(1.0, -1.0, 1.0, 1.0) * (frame.projection * frame.view * world);");
    "vertex-mirrored":
        (VS, CLIP, "vec4f(-1.0, 1.0, 1.0, 1.0) * (frame.projection * frame.view * world);");
    "vertex-depth-is-w": (VS, CLIP, "(frame.projection * frame.view * world).xyww;");
    "vertex-clip-w-zero":
        (VS, RETURN, "out.clip_position = vec4f(out.clip_position.xyz, 0.0);\n    return out;");
    "vertex-shifted":
        (VS, RETURN, "out.clip_position.x += 0.002 * out.clip_position.w;\n    return out;");
}
