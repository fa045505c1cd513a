# The teapot through Mitsuba 3: one camera ray and one shadow ray for each sample, as Umbra's
# reference. Prints seconds of CPU time: of the start until the scene is there, of a first image with
# the compilation of its kernel, and of a second.
import sys
import time

begin = time.process_time()
import drjit as dr
import mitsuba as mi

variant, obj = sys.argv[1:3]
mi.set_variant(variant)

# Mitsuba takes one material for a file.
head, groups, use = [], {}, None
for line in open(obj):
    word = line.split(" ", 1)[0].strip()
    if word in ("v", "vn", "vt"):
        head.append(line)
    elif word == "usemtl":
        use = line.split()[1]
    elif word == "f":
        groups.setdefault(use, []).append(line)

light = [[float(x) for x in head_line.split()[1:4]] for head_line in head if head_line.startswith("v ")]
corners = [int(corner.split("/")[0]) - 1 for face in groups.pop("light") for corner in face.split()[1:]]
center = [sum(light[c][axis] for c in corners) / len(corners) for axis in range(3)]

scene = {
    "type": "scene",
    "integrator": {"type": "direct", "emitter_samples": 1, "bsdf_samples": 0},
    "light": {"type": "point", "position": center, "intensity": {"type": "rgb", "value": [210, 204, 192]}},
    "sensor": {
        "type": "perspective",
        "fov": 29.0,
        "fov_axis": "y",
        "to_world": mi.ScalarTransform4f().look_at([1.6, 5.0, 12.5], [0.7, 1.2, 0.3], [0, 1, 0]),
        "film": {"type": "hdrfilm", "width": 768, "height": 576, "rfilter": {"type": "box"}},
        "sampler": {"type": "independent", "sample_count": 16},
    },
}
for name, faces in groups.items():
    path = f"{sys.argv[3]}/{name}.obj"
    with open(path, "w") as file:
        file.writelines(head + faces)
    color = {"type": "rgb", "value": [0.6, 0.4, 0.3]}
    glossy = {"type": "roughplastic", "diffuse_reflectance": color}
    bsdf = {"type": "diffuse", "reflectance": color} if name == "backdrop" else glossy
    scene[name] = {"type": "obj", "filename": path, "bsdf": {"type": "twosided", "inner": bsdf}}

loaded = mi.load_dict(scene)
times = [time.process_time() - begin]
for seed in range(2):
    begin = time.process_time()
    image = mi.render(loaded, spp=16, seed=seed)
    dr.eval(image)
    dr.sync_thread()
    times.append(time.process_time() - begin)
mi.Bitmap(image).write(f"{sys.argv[3]}/mitsuba.exr")
print(*times)
