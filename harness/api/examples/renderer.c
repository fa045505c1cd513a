/* A whole renderer in plain C.
 *
 * Images and radiance are a constant color; BSDF queries about diffuse materials given by value are
 * right; all else is answered with "not implemented". To build it and draw a scene with it:
 *
 *     cc -shared -fPIC -std=c11 -I harness/api/include harness/api/examples/renderer.c -o constant.so
 *     umbra render SCENE.toml --plugin constant.so --output constant.exr
 */
#include "umbra_renderer.h"

#include <string.h>

#define TEXT(s) {(const uint8_t *)(s), sizeof(s) - 1}

/* There is nothing to remember of a scene, but its handle must not be null. */
static int the_scene;

static UmbraStatus say(UmbraMessage *message, UmbraStatus status, const char *text)
{
    size_t length = strlen(text);
    if (length > message->capacity)
        length = message->capacity;
    memcpy(message->data, text, length);
    message->length = length;
    return status;
}

static void constant(float *values, size_t count)
{
    for (size_t i = 0; i < count; i++) {
        values[3 * i + 0] = 0.25f;
        values[3 * i + 1] = 0.5f;
        values[3 * i + 2] = 0.75f;
    }
}

static UmbraStatus load_scene(const UmbraSceneRequest *request, UmbraScene *scene,
                              UmbraMessage *message)
{
    if (request->path.length == 0)
        return say(message, UMBRA_STATUS_ERROR, "the scene has no path");
    *scene = &the_scene;
    return UMBRA_STATUS_OK;
}

static void unload_scene(UmbraScene scene)
{
    (void)scene;
}

static UmbraStatus set_witness(UmbraScene scene, const UmbraWitnessBsdf *witness,
                               UmbraMessage *message)
{
    (void)scene;
    if (witness == NULL)
        return UMBRA_STATUS_OK;
    return say(message, UMBRA_STATUS_NOT_IMPLEMENTED, "witness BSDFs");
}

static UmbraStatus eval_bsdf(UmbraScene scene, const UmbraBsdfQuery *queries, size_t count,
                             float *values, UmbraMessage *message)
{
    const float inv_pi = 0.318309886f;
    (void)scene;
    for (size_t i = 0; i < count; i++) {
        const UmbraBsdfQuery *q = &queries[i];
        float cos_i = q->wi[2];
        if (q->source != UMBRA_BSDF_OF_VALUE || q->material.model != UMBRA_MATERIAL_DIFFUSE)
            return say(message, UMBRA_STATUS_NOT_IMPLEMENTED, "other BSDFs than diffuse ones");
        for (int c = 0; c < 3; c++) {
            int lit = cos_i > 0 && q->wo[2] > 0;
            values[3 * i + c] = lit ? q->material.diffuse[c] * inv_pi * cos_i : 0;
        }
    }
    return UMBRA_STATUS_OK;
}

static UmbraStatus radiance(UmbraScene scene, const UmbraRadianceSettings *settings,
                            const UmbraRayQuery *rays, size_t count, float *values,
                            UmbraMessage *message)
{
    (void)scene, (void)settings, (void)rays, (void)message;
    constant(values, count);
    return UMBRA_STATUS_OK;
}

static UmbraStatus render_offline(UmbraScene scene, const UmbraOfflineSettings *settings,
                                  float *pixels, size_t float_count, UmbraMessage *message)
{
    size_t count = (size_t)settings->width * settings->height;
    (void)scene;
    if (float_count != 3 * count)
        return say(message, UMBRA_STATUS_ERROR, "the film has another size than the buffer");
    constant(pixels, count);
    if (settings->progress != NULL)
        settings->progress(settings->user, settings->height, settings->height);
    return UMBRA_STATUS_OK;
}

static UmbraStatus open_realtime(UmbraScene scene, const UmbraRealtimeSettings *settings,
                                 UmbraPass *pass, UmbraMessage *message)
{
    (void)scene, (void)settings, (void)pass;
    return say(message, UMBRA_STATUS_NOT_IMPLEMENTED, "realtime");
}

static UmbraStatus draw_frame(UmbraPass pass, const UmbraCameraValue *camera,
                              UmbraMessage *message)
{
    (void)pass, (void)camera;
    return say(message, UMBRA_STATUS_NOT_IMPLEMENTED, "realtime");
}

static UmbraStatus read_frame(UmbraPass pass, float *pixels, size_t float_count,
                              UmbraMessage *message)
{
    (void)pass, (void)pixels, (void)float_count;
    return say(message, UMBRA_STATUS_NOT_IMPLEMENTED, "realtime");
}

static void close_realtime(UmbraPass pass)
{
    (void)pass;
}

const UmbraPlugin umbra_renderer_plugin = {
    .magic = UMBRA_MAGIC,
    .interface_version = UMBRA_INTERFACE_VERSION,
    .struct_size = sizeof(UmbraPlugin),
    .name = TEXT("plain C"),
    .version = TEXT("1.0"),
    .load_scene = load_scene,
    .unload_scene = unload_scene,
    .set_witness = set_witness,
    .eval_bsdf = eval_bsdf,
    .radiance = radiance,
    .render_offline = render_offline,
    .open_realtime = open_realtime,
    .draw_frame = draw_frame,
    .read_frame = read_frame,
    .close_realtime = close_realtime,
};
