// An OBJ file through tinyobjloader: prints seconds and triangles.
#define TINYOBJLOADER_IMPLEMENTATION
#include <chrono>
#include <cstdio>
#include <tiny_obj_loader.h>

int main(int argc, char **argv) {
    tinyobj::ObjReader reader;
    auto begin = std::chrono::steady_clock::now();
    if (argc < 2 || !reader.ParseFromFile(argv[1])) return 1;
    std::chrono::duration<double> seconds = std::chrono::steady_clock::now() - begin;
    size_t triangles = 0;
    for (auto &shape : reader.GetShapes()) triangles += shape.mesh.num_face_vertices.size();
    printf("%.9f %zu\n", seconds.count(), triangles);
    return 0;
}
