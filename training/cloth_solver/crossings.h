/* Which triangles of two meshes, or of one, intersect: the referee of simulated and predicted cloth.
 *
 * Exact: coordinates are rounded to 2^-26 m (15 nm, finer than a float beyond 0.25 m), and on that grid every sign of
 * an orientation is the true one. No tolerance, no random numbers. Triangles that only touch count as intersecting. */
#ifndef DCLOTH_CROSSINGS_H_
#define DCLOTH_CROSSINGS_H_

#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

/* Writes the intersecting pairs into pair [capacity, 2], sorted, and returns how many there are, which may be more than
 * `capacity`. -1: a coordinate is not finite or lies 16 m or more from the middle of the first mesh, or a face names a
 * vertex that is not there.
 *
 * vertex [vertices, 3] m, face [faces, 3]; pair[k] = (index in face, index in other_face).
 * other = NULL: pairs within the mesh, the lower index first. Triangles that share a vertex do not count then: the same
 * index, or another one at the same place (the two sides of a UV seam).
 * Triangles without area do not count where they lie in the plane of the other.
 *
 * One thread. Two meshes of 16,000 triangles cost about 10 ms. */
int64_t cloth_crossings(const double* vertex, int32_t vertices, const int32_t* face, int32_t faces, const double* other,
                        int32_t other_vertices, const int32_t* other_face, int32_t other_faces, int32_t* pair,
                        int64_t capacity);

#ifdef __cplusplus
}
#endif
#endif
