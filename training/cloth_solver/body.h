// The body as cloth touches it: parts, each a surface of triangles with a true signed distance. A cloth vertex is
// followed over each part from step to step, and searched for again in every frame. A part may be open where it was cut
// from its neighbour: beside its border it is not touched.
#pragma once
#include <array>
#include <cstdint>
#include <vector>

#include "vec.h"

namespace cloth_solver {

struct Contact {
  bool near = false;   // false: farther than asked about
  float distance = 0;  // m, signed, positive outside
  Vec normal;          // towards the outside
  Vec velocity;        // of the surface there, m/s
};

class Body {
 public:
  // face [faces, 3], part [faces]; touches [cloth vertices] bit p: the vertex touches part p; empty: all do.
  Body(int32_t vertices, int32_t faces, const int32_t* face, const int32_t* part, int32_t parts,
       std::vector<uint32_t> touches, int32_t cloth_vertices);

  // Where the body is at the start and the end of a frame, and how far cloth may travel in it. Finds the cloth vertices
  // that may touch each part within `reach` of it.
  void BeginFrame(std::vector<Vec> from, std::vector<Vec> to, float seconds, const std::vector<Vec>& cloth,
                  float cloth_travel, float reach);
  void MoveTo(float t);  // the body at t in 0..1 of the frame
  int32_t parts() const { return static_cast<int32_t>(parts_.size()); }
  const std::vector<int32_t>& candidates(int32_t p) const { return parts_[p].candidates; }

  // The signed distance of candidate number `k` of part p at `at`, if it may be below `limit`. A vertex that was
  // farther away is not looked at again before it can have come within reach.
  Contact Touch(int32_t p, int32_t k, const Vec& at, float limit);

 private:
  struct Node {
    Vec low, high;
    int32_t first, count;  // faces of a leaf; count 0: children at `first` and `first` + 1
  };
  struct Part {
    std::vector<std::array<int32_t, 3>> faces;
    std::vector<std::array<int32_t, 3>> across;  // face across each edge (v[k], v[k+1]), -1 at a border
    std::vector<int32_t> around_first, around;   // CSR: faces about each body vertex, by local vertex number
    std::vector<uint8_t> border;                 // by local vertex number: on an edge without a face across
    std::vector<int32_t> local;                  // body vertex -> local number, -1
    std::vector<int32_t> vertices;
    std::vector<Node> nodes;
    std::vector<int32_t> order;                  // faces in the order of leaves
    float step_travel = 0;                       // m that any of its vertices moves between two calls of MoveTo
    std::vector<int32_t> candidates, face;       // cloth vertices, and the face each is nearest to
    std::vector<Vec> seen_at;                    // where the distance was last measured
    std::vector<float> clear;                    // m beyond the limit at that time, less the body's travel since
  };
  struct Nearest {
    int32_t face = -1;
    float squared = 0;
    Vec point;
    std::array<float, 3> weight{};
  };
  void Build(Part* part);
  void Refit(Part* part);
  static Nearest On(const std::vector<Vec>& at, const Part& part, int32_t face, const Vec& p);
  Nearest Search(const Part& part, const Vec& p, float reach, int32_t guess) const;
  Vec FaceNormal(const Part& part, int32_t face) const;  // not of unit length
  bool OnBorder(const Part& part, const Nearest& nearest) const;
  Vec PseudoNormal(const Part& part, const Nearest& nearest) const;

  std::vector<Part> parts_;
  std::vector<uint32_t> touches_;
  std::vector<std::vector<int32_t>> last_face_;  // [part][cloth vertex], a guess for the next frame
  float per_second_ = 0, t_ = 0;
  std::vector<Vec> from_, to_, at_;
};

}  // namespace cloth_solver
