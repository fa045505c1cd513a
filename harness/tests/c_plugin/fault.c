/* A plugin that misbehaves on purpose. What it does in each call is the scene's options text;
 * without options it draws zeros. FAULT_AT_LOAD makes a constructor that ends the worker.
 * With ATTACKS it is linked with hostile/attack.c, and options of several words are an attack;
 * ATTACK_AT_LOAD is one for the constructor. With ACTIONS it is linked with hostile/actions.c, which
 * knows more. WRONG_MAGIC, WRONG_VERSION, WRONG_SIZE and NULL_ENTRY make tables that a host must
 * refuse. */
#include "umbra_renderer.h"

#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

#define TEXT(s) {(const uint8_t *)(s), sizeof(s) - 1}

#define LONGEST 4096

#ifdef WRONG_MAGIC
#define TABLE_MAGIC 0x1122334455667788u
#else
#define TABLE_MAGIC UMBRA_MAGIC
#endif
#ifdef WRONG_VERSION
#define TABLE_VERSION 77
#else
#define TABLE_VERSION UMBRA_INTERFACE_VERSION
#endif
#ifdef WRONG_SIZE
#define TABLE_SIZE 64
#else
#define TABLE_SIZE sizeof(UmbraPlugin)
#endif
#ifdef NULL_ENTRY
#define RADIANCE NULL
#else
#define RADIANCE radiance
#endif

typedef struct {
    char mode[LONGEST];
} Loaded;

static int is(UmbraScene scene, const char *mode)
{
    return strcmp(((Loaded *)scene)->mode, mode) == 0;
}

#ifdef FAULT_AT_LOAD
__attribute__((constructor)) static void at_load(void)
{
    _exit(3);
}
#endif

#ifdef ATTACKS
int attack(int argc, char **argv);

static void attack_by(const char *text)
{
    char copy[LONGEST], *words[8], *rest = copy;
    int count = 0;
    snprintf(copy, sizeof copy, "%s", text);
    while (count < 7 && (words[count] = strsep(&rest, " ")) != NULL)
        count++;
    words[count] = NULL;
    attack(count, words);
}
#endif

#ifdef ACTIONS
/* Answers whether it knows the action. */
int action(const char *what, float *values, size_t count, UmbraMessage *message,
         UmbraStatus *status);
/* Remembers a stage's text by every means, or tells what is remembered. */
void remember(const char *where, const UmbraText *text);
int recall(const char *where, UmbraMessage *message);
#endif

#ifdef ATTACK_AT_LOAD
__attribute__((constructor)) static void attack_at_load(void)
{
    attack_by(ATTACK_AT_LOAD);
}
#endif

static UmbraStatus load_scene(const UmbraSceneRequest *request, UmbraScene *scene,
                              UmbraMessage *message)
{
    size_t length = request->options.length;
    Loaded *loaded = calloc(1, sizeof *loaded);
    (void)message;
    memcpy(loaded->mode, request->options.data, length < LONGEST ? length : LONGEST - 1);
    *scene = is(loaded, "null_scene") ? NULL : (UmbraScene)loaded;
    return UMBRA_STATUS_OK;
}

static void unload_scene(UmbraScene scene)
{
    free(scene);
}

__attribute__((noinline)) static int recurse(volatile int *above)
{
    volatile int here[512];
    here[0] = above[0] + 1;
    return recurse(here) + here[0];
}

static void daemon_that_holds_the_pipe(void)
{
    if (fork() == 0) {
        setsid();
        sleep(3);
        _exit(0);
    }
    _exit(0);
}

static UmbraStatus act(UmbraScene scene, float *pixels, size_t float_count, UmbraMessage *message)
{
    static int start[1], drawn;
    memset(pixels, 0, float_count * sizeof(float));
#ifdef ACTIONS
    UmbraStatus status = UMBRA_STATUS_OK;
    if (action(((Loaded *)scene)->mode, pixels, float_count, message, &status))
        return status;
#endif
#ifdef ATTACKS
    if (strchr(((Loaded *)scene)->mode, ' ') != NULL)
        attack_by(((Loaded *)scene)->mode);
#endif
    if (is(scene, "first") && drawn > 0)
        abort();
    drawn++;
    if (is(scene, "abort"))
        abort();
    if (is(scene, "segv"))
        *(volatile int *)8 = 1;
    if (is(scene, "exit0"))
        exit(0);
    if (is(scene, "loop"))
        for (volatile int i = 0;; i++)
            ;
    if (is(scene, "sleep"))
        sleep(1000);
    /* Hangs until the named file is there, which it makes. */
    if (strncmp(((Loaded *)scene)->mode, "once ", 5) == 0 &&
        open(((Loaded *)scene)->mode + 5, O_CREAT | O_EXCL | O_WRONLY, 0600) >= 0)
        sleep(1000);
    if (is(scene, "stack"))
        return recurse(start);
    if (is(scene, "busy"))
        while (clock() < 2 * CLOCKS_PER_SEC / 5)
            ;
    if (is(scene, "flood"))
        for (;;)
            puts("all work and no play makes Jack a dull boy");
    if (is(scene, "memory"))
        for (;;) {
            char *more = malloc(16 << 20);
            if (more == NULL)
                abort();
            memset(more, 1, 16 << 20);
        }
    if (is(scene, "past_end"))
        pixels[float_count] = 1;
    if (is(scene, "before_start"))
        pixels[-1] = 1;
    if (is(scene, "status"))
        return 77;
    if (is(scene, "long_message")) {
        message->length = (size_t)-1;
        return UMBRA_STATUS_ERROR;
    }
    if (is(scene, "no_adapter"))
        return UMBRA_STATUS_NO_ADAPTER;
    if (is(scene, "fork")) {
        if (fork() == 0)
            sleep(1000);
        abort();
    }
    if (is(scene, "daemon"))
        daemon_that_holds_the_pipe();
    if (is(scene, "truncate")) {
        if (truncate("/job/output", 0) != 0 && truncate("../output", 0) != 0)
            abort();
    }
    return UMBRA_STATUS_OK;
}

static UmbraStatus render_offline(UmbraScene scene, const UmbraOfflineSettings *settings,
                                  float *pixels, size_t float_count, UmbraMessage *message)
{
    (void)settings;
    return act(scene, pixels, float_count, message);
}

static UmbraStatus set_witness(UmbraScene s, const UmbraWitnessBsdf *w, UmbraMessage *m)
{
    (void)s, (void)w, (void)m;
    return UMBRA_STATUS_OK;
}
static UmbraStatus eval_bsdf(UmbraScene s, const UmbraBsdfQuery *q, size_t n, float *v,
                             UmbraMessage *m)
{
    (void)q;
    return act(s, v, 3 * n, m);
}
#ifndef NULL_ENTRY
static UmbraStatus radiance(UmbraScene s, const UmbraRadianceSettings *t, const UmbraRayQuery *r,
                            size_t n, float *v, UmbraMessage *m)
{
    (void)t, (void)r;
    return act(s, v, 3 * n, m);
}
#endif
/* A pass is its scene. */
static UmbraStatus open_realtime(UmbraScene s, const UmbraRealtimeSettings *t, UmbraPass *p,
                                 UmbraMessage *m)
{
    (void)t, (void)m;
#ifdef ACTIONS
    const char *mode = ((Loaded *)s)->mode;
    if (strncmp(mode, "keep ", 5) == 0) {
        if (t->stage_count > 0)
            remember(mode + 5, &t->stages[0].source);
        else if (recall(mode + 5, m))
            return UMBRA_STATUS_ERROR;
    }
#endif
    *p = s;
    return UMBRA_STATUS_OK;
}
static UmbraStatus draw_frame(UmbraPass p, const UmbraCameraValue *c, UmbraMessage *m)
{
    (void)p, (void)c, (void)m;
    return UMBRA_STATUS_OK;
}
static UmbraStatus read_frame(UmbraPass p, float *v, size_t n, UmbraMessage *m)
{
    return act(p, v, n, m);
}
static void close_realtime(UmbraPass p)
{
    (void)p;
}

const UmbraPlugin umbra_renderer_plugin = {
    .magic = TABLE_MAGIC,
    .interface_version = TABLE_VERSION,
    .struct_size = TABLE_SIZE,
    .name = TEXT("fault"),
    .version = TEXT("1.0"),
    .load_scene = load_scene,
    .unload_scene = unload_scene,
    .set_witness = set_witness,
    .eval_bsdf = eval_bsdf,
    .radiance = RADIANCE,
    .render_offline = render_offline,
    .open_realtime = open_realtime,
    .draw_frame = draw_frame,
    .read_frame = read_frame,
    .close_realtime = close_realtime,
};
