/* Plays a bundle as a game would and prints the last deltas, exactly. usage: program BUNDLE FRAMES MOTION
 * MOTION is little-endian f32: for each frame 3 numbers a joint, then 3 of the root. */
#include "softtissue.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define CHECK(is)                                                                                                      \
    do {                                                                                                               \
        if (!(is)) {                                                                                                   \
            fprintf(stderr, "line %d: %s (%s)\n", __LINE__, #is, softtissue_error());                                  \
            exit(1);                                                                                                   \
        }                                                                                                              \
    } while (0)

/* A file of a folder. */
static uint8_t *whole(const char *folder, const char *name, size_t *size) {
    char path[4096];
    CHECK(snprintf(path, sizeof path, "%s/%s", folder, name) < (int)sizeof path);
    FILE *file = fopen(path, "rb");
    CHECK(file && fseek(file, 0, SEEK_END) == 0);
    *size = (size_t)ftell(file);
    rewind(file);
    uint8_t *bytes = malloc(*size);
    CHECK(bytes && fread(bytes, 1, *size, file) == *size);
    fclose(file);
    return bytes;
}

int main(int argc, char **argv) {
    CHECK(argc == 4);

    /* what cannot be is told, not crashed on */
    CHECK(softtissue_bundle_open("/nowhere") == NULL && strstr(softtissue_error(), "/nowhere"));
    CHECK(softtissue_bundle_open(NULL) == NULL && strstr(softtissue_error(), "folder is NULL"));
    CHECK(softtissue_vertex_count(NULL) == 0 && softtissue_faces(NULL) == NULL);
    CHECK(softtissue_step(NULL, NULL, NULL, 0, NULL) == SOFTTISSUE_FAILED);
    softtissue_bundle_close(NULL);
    softtissue_player_free(NULL);

    softtissue_bundle *opened = softtissue_bundle_open(argv[1]);
    CHECK(opened);
    size_t sizes[3];
    uint8_t *manifest = whole(argv[1], "manifest.json", &sizes[0]), *body = whole(argv[1], "body.safetensors", &sizes[1]),
            *model = whole(argv[1], "model.safetensors", &sizes[2]);
    softtissue_bundle *bundle = softtissue_bundle_from_memory(manifest, sizes[0], body, sizes[1], model, sizes[2]);
    CHECK(bundle && softtissue_vertex_count(bundle) == softtissue_vertex_count(opened));
    softtissue_bundle_close(opened);
    body[sizes[1] - 1] ^= 1;
    CHECK(softtissue_bundle_from_memory(manifest, sizes[0], body, sizes[1], model, sizes[2]) == NULL);
    CHECK(strstr(softtissue_error(), "body.safetensors"));
    CHECK(softtissue_bundle_from_memory(manifest, sizes[0], NULL, 1, NULL, 0) == NULL);
    free(manifest);
    free(body);
    free(model);
    size_t vertices = softtissue_vertex_count(bundle), joints = softtissue_joint_count(bundle);
    CHECK(vertices > 0 && joints > 0 && softtissue_shape_count(bundle) > 0);
    CHECK(softtissue_frames_per_second(bundle) > 0);
    const uint32_t *faces = softtissue_faces(bundle);
    for (size_t i = 0; i < 3 * softtissue_face_count(bundle); i++) CHECK(faces[i] < vertices);
    char name[4];
    CHECK(softtissue_joint_name(bundle, 1, name, sizeof name) == 6 && strcmp(name, "mid") == 0);
    CHECK(softtissue_joint_name(bundle, joints, name, sizeof name) == 0);
    CHECK(softtissue_joint_parent(bundle, 0) == -1 && softtissue_joint_parent(bundle, 1) == 0);

    const float nan_shape[1] = {NAN}, shape[2] = {0.5f, -1.0f};
    CHECK(softtissue_player_new(bundle, nan_shape, 1) == NULL && strstr(softtissue_error(), "shape coefficient 0"));
    softtissue_player *player = softtissue_player_new(bundle, shape, 2);
    CHECK(player);
    softtissue_bundle_close(bundle); /* the player goes on */

    size_t frames = (size_t)atol(argv[2]), numbers = 3 * joints + 3;
    float *motion = malloc(frames * numbers * sizeof *motion), *posed = malloc(3 * vertices * sizeof *posed);
    FILE *file = fopen(argv[3], "rb");
    CHECK(file && fread(motion, sizeof *motion, frames * numbers, file) == frames * numbers);
    fclose(file);

    CHECK(softtissue_control(player, "nose", 1, 1, 1, 0) == -1 && strstr(softtissue_error(), "nose"));
    CHECK(softtissue_control(player, "everywhere", 1e9f, 1, 1, 0) == -1 && strstr(softtissue_error(), "gain"));
    CHECK(softtissue_control(player, "belly", 1.5f, 1, 1, 0) == 0);
    CHECK(softtissue_detail(player, 1000000, NULL) == -1 && strstr(softtissue_error(), "components"));
    CHECK(softtissue_detail(player, 0, "head, nose") == -1 && strstr(softtissue_error(), "nose"));
    CHECK(softtissue_detail(player, 1, "feet,belly") == 0);
    softtissue_step(player, motion, motion + 3 * joints, 0, NULL);
    for (size_t i = 0; i < 3 * vertices; i++) CHECK(softtissue_deltas(player)[i] == 0);
    CHECK(softtissue_detail(player, 0, NULL) == 0);
    softtissue_reset(player);
    for (size_t t = 0; t < frames; t++) {
        const float *pose = motion + t * numbers;
        uint32_t report = softtissue_step(player, pose, pose + 3 * joints, 0, posed);
        CHECK((report & ~(uint32_t)SOFTTISSUE_FEATURES_CLIPPED) == 0);
    }
    const float *deltas = softtissue_deltas(player);
    for (size_t i = 0; i < 3 * vertices; i++) printf("%a %a\n", deltas[i], posed[i]);
    size_t count = 0;
    const float *features = softtissue_features(player, &count);
    CHECK(count > 0 && isfinite(features[count - 1]) && softtissue_features(player, NULL) == NULL);

    /* how far to trust it, and fading where not */
    CHECK(softtissue_trust(player) > 0 && softtissue_trust(player) <= 1 && softtissue_trust(NULL) == 0);
    CHECK(softtissue_latency(player) == 0);
    CHECK(softtissue_fade(player, 2, 0, 1) == -1 && strstr(softtissue_error(), "trust"));
    CHECK(softtissue_fade(player, 0.5f, 0.2f, 0.5f) == 0);

    /* a broken pose, and a time step that is none */
    motion[0] = NAN;
    CHECK(softtissue_step(player, motion, motion + 3 * joints, 0.02f, posed) & SOFTTISSUE_POSE_HELD);
    CHECK(isfinite(posed[0]));
    const float *second = motion + numbers;
    CHECK(softtissue_step(player, motion + numbers, motion + numbers + 3 * joints, -1, NULL) == SOFTTISSUE_TIME_IGNORED);
    CHECK(softtissue_step(player, NULL, motion, 0, NULL) == SOFTTISSUE_FAILED);
    softtissue_reset(player);
    CHECK(deltas[0] == 0);
    CHECK((softtissue_pre_roll(player, second, second + 3 * joints, 1) & SOFTTISSUE_POSE_HELD) == 0 && deltas[0] != 0);
    CHECK(softtissue_pre_roll(player, motion, motion + 3 * joints, NAN) & SOFTTISSUE_POSE_HELD);
    CHECK(softtissue_pre_roll(player, NULL, NULL, 1) == SOFTTISSUE_FAILED);
    softtissue_player_free(player);
    free(motion);
    free(posed);
    return 0;
}
