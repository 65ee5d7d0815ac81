// The body as cloth touches it: parts, each a surface of triangles with a true signed distance. For each cloth vertex
// and part a lower bound of that distance is kept, less what both have moved since, so that only vertices nearby are
// looked at. The first look in a frame searches the whole part; later ones follow the surface from face to face. A part
// may be open where it was cut from its neighbour: beside its border it is not touched.
#pragma once
#include <array>
#include <cstdint>
#include <vector>

#include "lanes.h"
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
  // face [faces, 3], part [faces]; touches [cloth vertices] bit p: the vertex touches part p.
  Body(int32_t vertices, int32_t faces, const int32_t* face, const int32_t* part, int32_t parts,
       const std::vector<uint32_t>& touches);

  // Where the body is at the start and the end of a frame: [vertices, 3] each, in the world, and the origin that cloth
  // is told about from now on.
  void BeginFrame(const float* from, const float* to, const Vec& origin, float seconds);
  void MoveTo(float t);  // the body at t in 0..1 of the frame
  int32_t parts() const { return static_cast<int32_t>(parts_.size()); }

  // Which of the cloth vertices from kLanes * `block` on, at `at`, may touch part p.
  Ints MayTouch(int32_t p, int32_t block, const Vecs& at) const {
    const Part& part = parts_[p];
    const Watched& watched = part.watched[block];
    const Vecs moved = at - watched.seen - part.anchor;
    const Floats clear = watched.clear - part.travelled;
    return (clear <= 0.0f) | (Dot(moved, moved) >= clear * clear);
  }
  // The signed distance of cloth vertex i at `at` from part p, if it is below `limit`.
  Contact Touch(int32_t p, int32_t i, const Vec& at, float limit);

 private:
  struct FaceBlock {  // one that ends early repeats its first
    std::array<int32_t, kLanes> face, corner[3];
  };
  struct Boxes {  // beside the part's anchor, over the whole frame
    Vecs low, high;
  };
  // Where the distance was last measured, beside the anchor, and how far beyond the limit it was, plus what the part
  // had travelled by then.
  struct Watched {
    Vecs seen;
    Floats clear;
  };
  struct Part {
    std::vector<std::array<int32_t, 3>> faces;
    std::vector<std::array<int32_t, 3>> across;  // face across each edge (v[k], v[k+1]), -1 at a border
    std::vector<int32_t> around_first, around;   // CSR: faces about each body vertex, by local vertex number
    std::vector<uint8_t> border;                 // by local vertex number: on an edge without a face across
    std::vector<int32_t> local;                  // body vertex -> local number, -1
    std::vector<int32_t> vertices;
    std::vector<FaceBlock> blocks;           // neighbours together
    std::vector<std::vector<Boxes>> levels;  // about each block of faces, each kLanes of those boxes, ...
    Vec anchor_from, anchor_to, anchor;          // mean of its vertices: cloth and part travel together
    float travel = 0, travelled = 0;  // m that any vertex moves beside the anchor in the frame, and has moved so far
    std::vector<Watched> watched;     // cloth vertices by block
    std::vector<int32_t> face;        // by cloth vertex: nearest when it was last looked at, -1
    std::vector<int32_t> searched;    // the frame in which it was last searched for over the whole part
  };
  struct Nearest {
    int32_t face = -1;
    float squared = 0;
    Vec point;
    std::array<float, 3> weight{};
  };
  void Sort(const Part& part, int32_t first, int32_t last, std::vector<int32_t>* order) const;
  void Build(Part* part) const;
  void Refit(Part* part) const;
  Nearest On(const Part& part, int32_t face, const Vec& p) const;
  Floats SquaredToFaces(const FaceBlock& faces, const Vec& p) const;
  void Descend(const Part& part, size_t level, int32_t block, const Vec& p, Nearest* best) const;
  Nearest Search(const Part& part, const Vec& p, int32_t guess) const;
  Nearest Follow(const Part& part, const Vec& p, int32_t face) const;
  Vec FaceNormal(const Part& part, int32_t face) const;  // not of unit length
  bool OnBorder(const Part& part, const Nearest& nearest) const;
  Vec PseudoNormal(const Part& part, const Nearest& nearest) const;

  std::vector<Part> parts_;
  int32_t frame_ = 0;
  float per_second_ = 0;
  std::vector<Point> from_, to_, at_;
};

}  // namespace cloth_solver
