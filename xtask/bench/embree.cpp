// Rays of one thread through Embree, beside Umbra's: `xtask bench` starts this with the file that it
// wrote ("robust" behind it: Embree's mode in which rays do not pass between triangles). For each line
// of standard input it measures "build" or a kind of rays and prints seconds and what was hit.
#if __has_include(<embree4/rtcore.h>)
#include <embree4/rtcore.h>
#else
#include <embree3/rtcore.h>
#endif
#include <chrono>
#include <cstdint>
#include <cstdio>
#include <iostream>
#include <limits>
#include <string>
#include <vector>

struct Ray {
    float origin[3], direction[3], min_t, max_t;
};

template <typename T> static std::vector<T> list(FILE *file) {
    uint32_t count = 0;
    if (fread(&count, sizeof count, 1, file) != 1) exit(1);
    std::vector<T> all(count);
    if (count && fread(all.data(), sizeof(T), count, file) != count) exit(1);
    return all;
}

static RTCRay ray_of(const Ray &from) {
    RTCRay ray{};
    ray.org_x = from.origin[0], ray.org_y = from.origin[1], ray.org_z = from.origin[2];
    ray.dir_x = from.direction[0], ray.dir_y = from.direction[1], ray.dir_z = from.direction[2];
    ray.tnear = from.min_t, ray.tfar = from.max_t, ray.mask = -1u;
    return ray;
}

int main(int argc, char **argv) {
    FILE *file = argc > 1 ? fopen(argv[1], "rb") : nullptr;
    if (!file) return 1;
    struct Corners { float at[9]; };
    auto corners = list<Corners>(file);
    std::vector<Ray> kinds[3] = {list<Ray>(file), list<Ray>(file), list<Ray>(file)};
    fclose(file);
    bool robust = argc > 2 && std::string(argv[2]) == "robust";
    RTCDevice device = rtcNewDevice(nullptr);
    RTCScene scene = nullptr;
    auto build = [&] {
        if (scene) rtcReleaseScene(scene);
        scene = rtcNewScene(device);
        if (robust) rtcSetSceneFlags(scene, RTC_SCENE_FLAG_ROBUST);
        RTCGeometry mesh = rtcNewGeometry(device, RTC_GEOMETRY_TYPE_TRIANGLE);
        size_t count = corners.size();
        auto *vertices = (float *)rtcSetNewGeometryBuffer(
            mesh, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, 12, 3 * count);
        auto *indices = (uint32_t *)rtcSetNewGeometryBuffer(
            mesh, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3, 12, count);
        for (size_t i = 0; i < 9 * count; i++) vertices[i] = corners[i / 9].at[i % 9];
        for (size_t i = 0; i < 3 * count; i++) indices[i] = uint32_t(i);
        rtcCommitGeometry(mesh);
        rtcAttachGeometry(scene, mesh);
        rtcReleaseGeometry(mesh);
        rtcCommitScene(scene);
    };
    build();
    for (std::string command; std::getline(std::cin, command);) {
        size_t hits = 0;
        auto begin = std::chrono::steady_clock::now();
        if (command == "build") {
            build();
        } else {
            size_t kind = std::stoul(command);
            for (const Ray &from : kinds[kind]) {
#if RTC_VERSION_MAJOR < 4
                RTCIntersectContext context;
                rtcInitIntersectContext(&context);
#endif
                if (kind == 1) {
                    RTCRay ray = ray_of(from);
#if RTC_VERSION_MAJOR < 4
                    rtcOccluded1(scene, &context, &ray);
#else
                    rtcOccluded1(scene, &ray);
#endif
                    hits += ray.tfar < 0.0f;
                } else {
                    RTCRayHit hit{};
                    hit.ray = ray_of(from);
                    hit.hit.geomID = RTC_INVALID_GEOMETRY_ID;
#if RTC_VERSION_MAJOR < 4
                    rtcIntersect1(scene, &context, &hit);
#else
                    rtcIntersect1(scene, &hit);
#endif
                    hits += hit.hit.geomID != RTC_INVALID_GEOMETRY_ID;
                }
            }
        }
        std::chrono::duration<double> seconds = std::chrono::steady_clock::now() - begin;
        printf("%.9f %zu\n", seconds.count(), hits);
        fflush(stdout);
    }
    return 0;
}
