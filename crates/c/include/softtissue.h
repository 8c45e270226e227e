/* Soft tissue on skeletal animation: the player of a softtissue bundle.
 *
 * Metres, radians, seconds, Y up. A pose is one rotation a joint, axis times angle in the parent's frame, in the order of
 * softtissue_joint_name, and the root's translation. Arrays belong to whoever made them; pointers that the library hands
 * out live as long as the object they were asked of, and say what the newest frame says.
 *
 * A player belongs to one thread at a time; a bundle may be shared by players on several threads and may be closed while
 * they live. No function keeps a pointer that it was given. softtissue_step allocates nothing.
 */
#ifndef SOFTTISSUE_H
#define SOFTTISSUE_H

#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

typedef struct softtissue_bundle softtissue_bundle;
typedef struct softtissue_player softtissue_player;

/* What a frame had to do so that its result is finite; bits of what softtissue_step returns. */
enum {
    SOFTTISSUE_POSE_HELD = 1,        /* the pose was unusable: the last good one stands in */
    SOFTTISSUE_TELEPORTED = 2,       /* the root was set down elsewhere, which was not taken for motion */
    SOFTTISSUE_FEATURES_CLIPPED = 4, /* the motion left what was seen in training; it is held at the limits */
    SOFTTISSUE_RESTARTED = 8,        /* the motion started over */
    SOFTTISSUE_TIME_IGNORED = 16,    /* the time step was no positive number */
    SOFTTISSUE_WAITING = 32,         /* no result yet: the model looks ahead */
    SOFTTISSUE_FAILED = 1 << 30      /* an argument was NULL; softtissue_error tells */
};

/* Opens a bundle folder, which is checked whole. NULL on failure. */
softtissue_bundle *softtissue_bundle_open(const char *folder);
/* The same of a bundle's three files in memory, which are copied: out of a game's archive, say. */
softtissue_bundle *softtissue_bundle_from_memory(const uint8_t *manifest, size_t manifest_size, const uint8_t *body,
                                                 size_t body_size, const uint8_t *model, size_t model_size);
void softtissue_bundle_close(softtissue_bundle *bundle);

/* Vertices, joints and triangles of the bundle's body; its shape coefficients; frames a second of the training. */
size_t softtissue_vertex_count(const softtissue_bundle *bundle);
size_t softtissue_joint_count(const softtissue_bundle *bundle);
size_t softtissue_face_count(const softtissue_bundle *bundle);
size_t softtissue_shape_count(const softtissue_bundle *bundle);
float softtissue_frames_per_second(const softtissue_bundle *bundle);
/* Three vertices a triangle, counter-clockwise from outside. */
const uint32_t *softtissue_faces(const softtissue_bundle *bundle);
/* Copies the name of a joint, cut to size bytes with its final zero. Returns its whole length; 0 where there is no such
 * joint. */
size_t softtissue_joint_name(const softtissue_bundle *bundle, size_t joint, char *name, size_t size);
/* Parent of a joint; -1 for the root and where there is no such joint. */
int softtissue_joint_parent(const softtissue_bundle *bundle, size_t joint);

/* A player of a body; missing shape coefficients count as zero. NULL on failure. */
softtissue_player *softtissue_player_new(const softtissue_bundle *bundle, const float *shape, size_t shape_count);
void softtissue_player_free(softtissue_player *player);
/* Forgets the motion: the next pose is a first one. */
void softtissue_reset(softtissue_player *player);
/* Changes what was learned of a region ("belly", "breast", ...; "everywhere" for all) and starts over: factors of the
 * displacement, of the time of the answer and of its damping, and a delay in seconds; 1, 1, 1, 0 changes nothing.
 * Returns 0, or -1 on failure. */
int softtissue_control(softtissue_player *player, const char *region, float gain, float softness, float damping,
                       float lag);
/* Level of detail, from the next frame on: makes the displacements of so many components of the basis, the most important
 * first (0 for all), and leaves the named regions rigid ("head,hands"; NULL for none). Never starts over. Returns 0, or -1 on
 * failure. */
int softtissue_detail(softtissue_player *player, size_t components, const char *still);
/* Fades the displacements out where the motion is unlike all that the bundle knows, and in again where it is not: below a
 * trust of 0 to 1 (0 never fades) that has lasted for patience seconds, over so many seconds; 0.5, 0.2, 0.5 are a good start.
 * Returns 0, or -1 on failure. */
int softtissue_fade(softtissue_player *player, float below, float patience, float seconds);
/* Starts over in the steady state of a pose, as if the body had stood in it for so many seconds, 0 to 60: the motion that
 * follows may begin in mid-movement and makes no jolt. Arrays and result as in softtissue_step. */
uint32_t softtissue_pre_roll(softtissue_player *player, const float *rotations, const float *translation, float seconds);
/* A frame, dt seconds after the last one; dt of 0 stands for one frame of the bundle's rate. rotations: 3 numbers a joint;
 * translation: 3; vertices: room for 3 a vertex, or NULL. Any dt gives the same motion. Returns bits of what had to be done. */
uint32_t softtissue_step(softtissue_player *player, const float *rotations, const float *translation, float dt,
                         float *vertices);
/* The body of the newest frame without its soft tissue: vertices has room for 3 numbers a vertex. Returns 0, or -1 on
 * failure. */
int softtissue_body_alone(softtissue_player *player, float *vertices);
/* Trust in the newest frame: 1 where motion and body are like those of the training, 0 far from them. */
float softtissue_trust(const softtissue_player *player);
/* Seconds between a pose and its displacements: 0 unless the model looks ahead. */
float softtissue_latency(const softtissue_player *player);
/* Displacements of the rest mesh, 3 numbers a vertex. */
const float *softtissue_deltas(const softtissue_player *player);
/* What an exported ONNX network takes of the newest frame; *count says how many. */
const float *softtissue_features(const softtissue_player *player, size_t *count);

/* Foreign motions; only in a library built with the feature "motion" (cargo build -p softtissue-c --features motion).
 *
 * Reads a BVH file that lies in memory and puts it onto the bundle's body of this shape, at the bundle's rate. name stands
 * in messages. NULL on failure. */
typedef struct softtissue_motion softtissue_motion;
softtissue_motion *softtissue_motion_from_bvh(const softtissue_bundle *bundle, const float *shape, size_t shape_count,
                                              const char *name, const uint8_t *bytes, size_t size);
void softtissue_motion_free(softtissue_motion *motion);
size_t softtissue_motion_length(const softtissue_motion *motion);
/* Rotations, 3 numbers a joint, frame after frame; translations, 3 numbers a frame. */
const float *softtissue_motion_rotations(const softtissue_motion *motion);
const float *softtissue_motion_translations(const softtissue_motion *motion);
/* What the file is and what was guessed of it, in a line; NULL for NULL. */
const char *softtissue_motion_facts(const softtissue_motion *motion);

/* Why the last call on this thread failed, until the next one fails; never NULL. */
const char *softtissue_error(void);

#ifdef __cplusplus
}
#endif
#endif
