/* The interface between Umbra and a renderer. Conventions, ownership and threads: see the
 * head of harness/api/src/lib.rs. Made by cbindgen; do not edit: UMBRA_REWRITE=1 rewrites it. */

#ifndef UMBRA_RENDERER_H
#define UMBRA_RENDERER_H

#include <stddef.h>
#include <stdint.h>

/*
 The first eight bytes of every plugin table: `UMBRAPLG` in memory on a little-endian machine.
 */
#define UMBRA_MAGIC 5137569516406066517

/*
 The version of this interface. Host and plugin must agree exactly.
 */
#define UMBRA_INTERFACE_VERSION 1

/*
 Lambertian reflection; `specular` and `exponent` are ignored.
 */
#define UMBRA_MATERIAL_DIFFUSE 0

/*
 Normalised Phong.
 */
#define UMBRA_MATERIAL_PHONG 1

/*
 The query's own [`BsdfQuery::material`], with constant textures.
 */
#define UMBRA_BSDF_OF_VALUE 0

/*
 What the scene hands out for `shape` and `primitive`, textures looked up at `uv`.
 */
#define UMBRA_BSDF_OF_SHAPE 1

/*
 A hardware adapter when there is one, a software adapter otherwise.
 */
#define UMBRA_ADAPTER_ANY 0

/*
 A software adapter only.
 */
#define UMBRA_ADAPTER_SOFTWARE 1

/*
 A hardware adapter only.
 */
#define UMBRA_ADAPTER_HARDWARE 2

/*
 What a function of the plugin answers: one of the `STATUS_*` values.

 An integer rather than an enum, because a faulty plugin can answer anything.
 */
typedef int32_t UmbraStatus;

/*
 Borrowed UTF-8 text. `data` may be null when `length` is 0.
 */
typedef struct {
    /*
     First byte.
     */
    const uint8_t *data;
    /*
     Number of bytes.
     */
    size_t length;
} UmbraText;

/*
 Which scene to load.
 */
typedef struct {
    /*
     Path of the scene's TOML file.
     */
    UmbraText path;
    /*
     Empty for every submission. The reference renderer reads `mistake=NAME` here, separated by
     commas, to make known mistakes on purpose; other plugins ignore it.
     */
    UmbraText options;
} UmbraSceneRequest;

/*
 An opaque scene of the plugin's.
 */
typedef void *UmbraScene;

/*
 Where the plugin writes the text that goes with a status, in a buffer of the host.
 */
typedef struct {
    /*
     First byte of the host's buffer.
     */
    uint8_t *data;
    /*
     Size of the buffer in bytes.
     */
    size_t capacity;
    /*
     Number of bytes of UTF-8 written, at most `capacity`.
     */
    size_t length;
} UmbraMessage;

/*
 What a witness BSDF is asked. Directions are in the local shading frame.
 */
typedef struct {
    /*
     The surface point, world space.
     */
    float position[3];
    /*
     The shading normal, world space.
     */
    float normal[3];
    /*
     Texture coordinates.
     */
    float uv[2];
    /*
     Direction toward the viewer as the integrator set it; not necessarily a unit vector.
     */
    float wo[3];
    /*
     Direction toward the light as the integrator set it; not necessarily a unit vector.
     */
    float wi[3];
    /*
     Index of the shape in the scene.
     */
    uint32_t shape;
    /*
     Index of the triangle within the shape.
     */
    uint32_t primitive;
} UmbraWitnessQuery;

/*
 A BSDF of the host's that takes the place of every BSDF the scene hands out.
 */
typedef struct {
    /*
     Passed back unchanged.
     */
    void *user;
    /*
     Writes the BSDF value (cosine included) to `value`, three floats. Callable from any thread.
     */
    void (*eval)(void *user, const UmbraWitnessQuery *query, float *value);
} UmbraWitnessBsdf;

/*
 A material by value, before any energy scale.
 */
typedef struct {
    /*
     One of the `MATERIAL_*` values.
     */
    uint32_t model;
    /*
     Diffuse albedo Kd, each component at least 0.
     */
    float diffuse[3];
    /*
     Specular albedo Ks, each component at least 0.
     */
    float specular[3];
    /*
     Phong exponent n, at least 0.
     */
    float exponent;
} UmbraMaterialValue;

/*
 One evaluation of a BSDF.
 */
typedef struct {
    /*
     One of the `BSDF_OF_*` values: whose BSDF is meant.
     */
    uint32_t source;
    /*
     The material, when `source` is [`BSDF_OF_VALUE`].
     */
    UmbraMaterialValue material;
    /*
     Index of the shape in the scene, when `source` is [`BSDF_OF_SHAPE`].
     */
    uint32_t shape;
    /*
     Index of the triangle within the shape.
     */
    uint32_t primitive;
    /*
     Texture coordinates at the surface point.
     */
    float uv[2];
    /*
     Unit direction toward the viewer, local shading frame.
     */
    float wo[3];
    /*
     Unit direction toward the light, local shading frame.
     */
    float wi[3];
} UmbraBsdfQuery;

/*
 How to compute radiance along a batch of rays.
 */
typedef struct {
    /*
     Whether occluders cast shadows.
     */
    uint32_t shadows;
    /*
     Seed of the sampler that the rays share.
     */
    uint64_t seed;
} UmbraRadianceSettings;

/*
 A ray segment, world space.
 */
typedef struct {
    /*
     Origin.
     */
    float origin[3];
    /*
     Hits closer than this are ignored.
     */
    float min_t;
    /*
     Unit direction.
     */
    float direction[3];
    /*
     Hits farther than this are ignored; may be infinite.
     */
    float max_t;
} UmbraRayQuery;

/*
 How to render an image offline. Every value is explicit: the host has resolved the scene's defaults.
 */
typedef struct {
    /*
     Film width in pixels.
     */
    uint32_t width;
    /*
     Film height in pixels.
     */
    uint32_t height;
    /*
     Samples per pixel. At 1 the sample is the pixel's centre.
     */
    uint32_t spp;
    /*
     Number of threads to render with, at least 1.
     */
    uint32_t threads;
    /*
     Seed of every sampler.
     */
    uint64_t seed;
    /*
     Whether occluders cast shadows.
     */
    uint32_t shadows;
    /*
     Passed back unchanged to the callbacks.
     */
    void *user;
    /*
     Called now and then with finished and total rows; may be null.
     */
    void (*progress)(void *user, uint32_t done, uint32_t total);
    /*
     Returns non-zero when the plugin should stop early; may be null.
     */
    uint32_t (*cancelled)(void *user);
} UmbraOfflineSettings;

/*
 The text of one shader stage, to be used in place of the plugin's own.
 */
typedef struct {
    /*
     Name of the stage file without `.wgsl`: `simple.vs`, `diffuse.fs` or `phong.fs`.
     */
    UmbraText name;
    /*
     WGSL source.
     */
    UmbraText source;
} UmbraStageText;

/*
 How to open a realtime pass. Every value is explicit.
 */
typedef struct {
    /*
     Film width in pixels.
     */
    uint32_t width;
    /*
     Film height in pixels.
     */
    uint32_t height;
    /*
     Whether to draw shadows by shadow mapping (the bonus).
     */
    uint32_t shadow_map;
    /*
     One of the `ADAPTER_*` values.
     */
    uint32_t adapter_kind;
    /*
     Case-insensitive part of the adapter's name; empty accepts any.
     */
    UmbraText adapter_name;
    /*
     Stages to replace; null when `stage_count` is 0.
     */
    const UmbraStageText *stages;
    /*
     Number of stages to replace.
     */
    size_t stage_count;
} UmbraRealtimeSettings;

/*
 An opaque realtime pass of the plugin's.
 */
typedef void *UmbraPass;

/*
 A camera for one frame.
 */
typedef struct {
    /*
     Position, world space.
     */
    float eye[3];
    /*
     Point looked at, world space.
     */
    float at[3];
    /*
     Up direction, world space, not necessarily unit or orthogonal.
     */
    float up[3];
    /*
     Full vertical field of view in degrees.
     */
    float fov_y_deg;
} UmbraCameraValue;

/*
 The table that a plugin exports under [`ENTRY_SYMBOL`].

 Every function returns a [`Status`] and writes a message when it is not [`STATUS_OK`]. Every
 entry must be set.
 */
typedef struct {
    /*
     [`MAGIC`].
     */
    uint64_t magic;
    /*
     [`INTERFACE_VERSION`].
     */
    uint32_t interface_version;
    /*
     `sizeof(Plugin)` as the plugin was compiled.
     */
    uint32_t struct_size;
    /*
     The renderer's name, valid while the library is loaded.
     */
    UmbraText name;
    /*
     The renderer's version, valid while the library is loaded.
     */
    UmbraText version;
    /*
     Loads a scene and stores a handle to it in `scene`.
     */
    UmbraStatus (*load_scene)(const UmbraSceneRequest *request,
                              UmbraScene *scene,
                              UmbraMessage *message);
    /*
     Frees a scene. No pass of it is open any more.
     */
    void (*unload_scene)(UmbraScene scene);
    /*
     Installs a witness BSDF for `radiance` and `render_offline`; null takes it away.
     */
    UmbraStatus (*set_witness)(UmbraScene scene,
                               const UmbraWitnessBsdf *witness,
                               UmbraMessage *message);
    /*
     Evaluates `count` queries into `values`, three floats each (cosine included).
     */
    UmbraStatus (*eval_bsdf)(UmbraScene scene,
                             const UmbraBsdfQuery *queries,
                             size_t count,
                             float *values,
                             UmbraMessage *message);
    /*
     Computes the radiance that arrives along `count` rays into `values`, three floats each.
     */
    UmbraStatus (*radiance)(UmbraScene scene,
                            const UmbraRadianceSettings *settings,
                            const UmbraRayQuery *rays,
                            size_t count,
                            float *values,
                            UmbraMessage *message);
    /*
     Renders an image into `pixels`, `width * height * 3` floats.
     */
    UmbraStatus (*render_offline)(UmbraScene scene,
                                  const UmbraOfflineSettings *settings,
                                  float *pixels,
                                  size_t float_count,
                                  UmbraMessage *message);
    /*
     Opens a realtime pass on a scene and stores a handle to it in `pass`.
     */
    UmbraStatus (*open_realtime)(UmbraScene scene,
                                 const UmbraRealtimeSettings *settings,
                                 UmbraPass *pass,
                                 UmbraMessage *message);
    /*
     Draws one frame for a camera. With [`STATUS_OK`] the message may hold five decimal numbers
     separated by spaces. They count what the pass did from its opening to this frame: bytes
     uploaded, textures to draw into, picture pipelines with vertices, picture pipelines without,
     and other pipelines.
     */
    UmbraStatus (*draw_frame)(UmbraPass pass, const UmbraCameraValue *camera, UmbraMessage *message);
    /*
     Reads the last frame back into `pixels`, `width * height * 3` linear floats.
     */
    UmbraStatus (*read_frame)(UmbraPass pass,
                              float *pixels,
                              size_t float_count,
                              UmbraMessage *message);
    /*
     Closes a pass.
     */
    void (*close_realtime)(UmbraPass pass);
} UmbraPlugin;

/*
 The call did what was asked.
 */
#define UMBRA_STATUS_OK 0

/*
 The call failed; the message says why.
 */
#define UMBRA_STATUS_ERROR 1

/*
 The part of the assignment that the call needs is not implemented yet; the message names it.
 */
#define UMBRA_STATUS_NOT_IMPLEMENTED 2

/*
 The plugin panicked and caught it; the message is the panic's.
 */
#define UMBRA_STATUS_PANICKED 3

/*
 The host asked to stop through [`OfflineSettings::cancelled`].
 */
#define UMBRA_STATUS_CANCELLED 4

/*
 The machine offers no suitable graphics adapter, or lost it. Believed only when confirmed.
 */
#define UMBRA_STATUS_NO_ADAPTER 5

#endif  /* UMBRA_RENDERER_H */

/* Export exactly this constant. C++: inside extern "C". */
extern const UmbraPlugin umbra_renderer_plugin;
