#include "body.h"

#include <algorithm>
#include <cmath>
#include <numeric>

namespace cloth_solver {
namespace {

constexpr float kDeepest = 0.03f;  // m: cloth sinks by millimetres in a step; what is deeper looks into an open end
constexpr float kFar = 0.1f;       // m: how far exactly is not asked beyond
constexpr float kTrusted = 0.02f;  // m: a face that was followed to says no more about the rest of the part
constexpr float kNowhere = 1e9f;   // m: a box that is not there
constexpr float kOnEdge = 1e-4f;   // barycentric weight below which the nearest point counts as on the edge

Vecs Spread(const Vec& v) { return {Floats{} + v.x, Floats{} + v.y, Floats{} + v.z}; }
Floats Lower(const Floats& a, const Floats& b) { return a < b ? a : b; }
Floats Higher(const Floats& a, const Floats& b) { return a > b ? a : b; }
Vecs Lower(const Vecs& a, const Vecs& b) { return {Lower(a.x, b.x), Lower(a.y, b.y), Lower(a.z, b.z)}; }
Vecs Higher(const Vecs& a, const Vecs& b) { return {Higher(a.x, b.x), Higher(a.y, b.y), Higher(a.z, b.z)}; }

Floats SquaredToBoxes(const Vecs& p, const Vecs& low, const Vecs& high) {
  const Vecs outside = Higher(Higher(low - p, p - high), Vecs{});
  return Dot(outside, outside);
}

int Lowest(const Floats& v, uint32_t among) {
  int best = __builtin_ctz(among);
  ForEachBit(among, [&](int k) { best = v[k] < v[best] ? k : best; });
  return best;
}

// The squared distance from p to the segment from a along ab.
Floats SquaredToSegment(const Vecs& ab, const Vecs& ap) {
  const Floats along = Dot(ab, ap) / Higher(Dot(ab, ab), Floats{} + 1e-20f);
  const Vecs away = ap - Lower(Higher(along, Floats{}), Floats{} + 1.0f) * ab;
  return Dot(away, away);
}

float AngleAt(const Vec& a, const Vec& b, const Vec& c) {
  const Vec u = Unit(b - a), v = Unit(c - a);
  return std::acos(std::clamp(Dot(u, v), -1.0f, 1.0f));
}

}  // namespace

Body::Body(int32_t vertices, int32_t faces, const int32_t* face, const int32_t* part, int32_t parts,
           const std::vector<uint32_t>& touches)
    : parts_(parts), from_(vertices), to_(vertices), at_(vertices) {
  for (int32_t f = 0; f < faces; ++f) parts_[part[f]].faces.push_back({face[3 * f], face[3 * f + 1], face[3 * f + 2]});
  for (Part& p : parts_) {
    p.local.assign(vertices, -1);
    for (const auto& v : p.faces)
      for (int32_t i : v)
        if (p.local[i] < 0) p.local[i] = static_cast<int32_t>(p.vertices.size()), p.vertices.push_back(i);
    p.around_first.assign(p.vertices.size() + 1, 0);
    for (const auto& v : p.faces)
      for (int32_t i : v) ++p.around_first[p.local[i] + 1];
    std::partial_sum(p.around_first.begin(), p.around_first.end(), p.around_first.begin());
    p.around.resize(p.around_first.back());
    std::vector<int32_t> next(p.around_first.begin(), p.around_first.end() - 1);
    for (int32_t f = 0; f < static_cast<int32_t>(p.faces.size()); ++f)
      for (int32_t i : p.faces[f]) p.around[next[p.local[i]]++] = f;
    p.across.assign(p.faces.size(), {-1, -1, -1});
    for (int32_t f = 0; f < static_cast<int32_t>(p.faces.size()); ++f)
      for (int k = 0; k < 3; ++k) {
        const int32_t a = p.faces[f][k], b = p.faces[f][(k + 1) % 3];
        for (int32_t j = p.around_first[p.local[a]]; j < p.around_first[p.local[a] + 1]; ++j) {
          const auto& g = p.faces[p.around[j]];
          for (int m = 0; m < 3; ++m)
            if (g[m] == b && g[(m + 1) % 3] == a) p.across[f][k] = p.around[j];
        }
      }
    p.border.assign(p.vertices.size(), 0);
    for (size_t f = 0; f < p.faces.size(); ++f)
      for (int k = 0; k < 3; ++k)
        if (p.across[f][k] < 0) p.border[p.local[p.faces[f][k]]] = p.border[p.local[p.faces[f][(k + 1) % 3]]] = 1;
    constexpr float kNever = 1e15f;
    p.watched.assign((touches.size() + kLanes - 1) / kLanes, Watched{{}, Floats{} + kNever});
    for (size_t i = 0; i < touches.size(); ++i)
      if (!p.faces.empty() && (touches[i] >> (&p - parts_.data()) & 1)) p.watched[i / kLanes].clear[i % kLanes] = 0;
    p.face.assign(touches.size(), -1), p.searched.assign(touches.size(), 0);
  }
}

// Faces order[first, last) so that each kLanes of them, and each kLanes of those, lie together.
void Body::Sort(const Part& part, int32_t first, int32_t last, std::vector<int32_t>* order) const {
  if (last - first <= kLanes) return;
  const auto centre = [&](int32_t f) {
    const auto& v = part.faces[f];
    return ToVec(from_[v[0]]) + ToVec(from_[v[1]]) + ToVec(from_[v[2]]);
  };
  Vec low{1e9f, 1e9f, 1e9f}, high{-1e9f, -1e9f, -1e9f};
  for (int32_t i = first; i < last; ++i) {
    const Vec c = centre((*order)[i]);
    low = {std::min(low.x, c.x), std::min(low.y, c.y), std::min(low.z, c.z)};
    high = {std::max(high.x, c.x), std::max(high.y, c.y), std::max(high.z, c.z)};
  }
  const Vec size = high - low;
  float Vec::*axis = size.x >= size.y && size.x >= size.z ? &Vec::x : size.y >= size.z ? &Vec::y : &Vec::z;
  std::sort(order->begin() + first, order->begin() + last, [&](int32_t f, int32_t g) {
    const float a = centre(f).*axis, b = centre(g).*axis;
    return a != b ? a < b : f < g;
  });
  const int32_t half = ((last - first) / 2 + kLanes - 1) / kLanes * kLanes;
  Sort(part, first, first + half, order);
  Sort(part, first + half, last, order);
}

void Body::Build(Part* part) const {
  std::vector<int32_t> order(part->faces.size());
  std::iota(order.begin(), order.end(), 0);
  Sort(*part, 0, static_cast<int32_t>(order.size()), &order);
  for (size_t first = 0; first < order.size(); first += kLanes) {
    FaceBlock& block = part->blocks.emplace_back();
    for (size_t k = 0; k < kLanes; ++k) {
      block.face[k] = order[first + k < order.size() ? first + k : first];
      for (int m = 0; m < 3; ++m) block.corner[m][k] = part->faces[block.face[k]][m];
    }
  }
  const Vecs nothing = Spread({kNowhere, kNowhere, kNowhere});
  for (size_t inner = part->blocks.size(); part->levels.empty() || inner > 1; inner = part->levels.back().size())
    part->levels.emplace_back((inner + kLanes - 1) / kLanes, Boxes{nothing, nothing});
}

void Body::Refit(Part* part) const {
  const auto keep = [](const Vecs& low, const Vecs& high, size_t k, std::vector<Boxes>* level) {
    Vec least{low.x[0], low.y[0], low.z[0]}, most{high.x[0], high.y[0], high.z[0]};
    for (int m = 1; m < kLanes && low.x[m] < kNowhere; ++m) {
      least = {std::min(least.x, low.x[m]), std::min(least.y, low.y[m]), std::min(least.z, low.z[m])};
      most = {std::max(most.x, high.x[m]), std::max(most.y, high.y[m]), std::max(most.z, high.z[m])};
    }
    Boxes& to = (*level)[k / kLanes];
    const size_t lane = k % kLanes;
    to.low.x[lane] = least.x, to.low.y[lane] = least.y, to.low.z[lane] = least.z;
    to.high.x[lane] = most.x, to.high.y[lane] = most.y, to.high.z[lane] = most.z;
  };
  for (size_t k = 0; k < part->blocks.size(); ++k) {
    Vecs low = Spread({kNowhere, kNowhere, kNowhere}), high = -1.0f * low;
    for (const auto& corner : part->blocks[k].corner) {
      const Vecs a = Gather(from_, corner) - part->anchor_from, b = Gather(to_, corner) - part->anchor_to;
      low = Lower(low, Lower(a, b)), high = Higher(high, Higher(a, b));
    }
    keep(low, high, k, &part->levels[0]);
  }
  for (size_t level = 1; level < part->levels.size(); ++level) {
    const std::vector<Boxes>& inner = part->levels[level - 1];
    for (size_t k = 0; k < inner.size(); ++k) keep(inner[k].low, inner[k].high, k, &part->levels[level]);
  }
}

// Ericson, "Real-time collision detection", 5.1.5: nearest point of a triangle with its barycentric weights.
Body::Nearest Body::On(const Part& part, int32_t face, const Vec& p) const {
  const auto& v = part.faces[face];
  const Vec a = ToVec(at_[v[0]]), b = ToVec(at_[v[1]]), c = ToVec(at_[v[2]]);
  const Vec ab = b - a, ac = c - a, ap = p - a;
  const float d1 = Dot(ab, ap), d2 = Dot(ac, ap);
  Nearest out;
  out.face = face;
  const auto done = [&](float wa, float wb, float wc) {
    out.weight = {wa, wb, wc};
    out.point = wa * a + wb * b + wc * c;
    const Vec d = p - out.point;
    out.squared = Dot(d, d);
    return out;
  };
  if (d1 <= 0 && d2 <= 0) return done(1, 0, 0);
  const Vec bp = p - b;
  const float d3 = Dot(ab, bp), d4 = Dot(ac, bp);
  if (d3 >= 0 && d4 <= d3) return done(0, 1, 0);
  const float vc = d1 * d4 - d3 * d2;
  if (vc <= 0 && d1 >= 0 && d3 <= 0) {
    const float w = d1 / std::max(d1 - d3, 1e-20f);
    return done(1 - w, w, 0);
  }
  const Vec cp = p - c;
  const float d5 = Dot(ab, cp), d6 = Dot(ac, cp);
  if (d6 >= 0 && d5 <= d6) return done(0, 0, 1);
  const float vb = d5 * d2 - d1 * d6;
  if (vb <= 0 && d2 >= 0 && d6 <= 0) {
    const float w = d2 / std::max(d2 - d6, 1e-20f);
    return done(1 - w, 0, w);
  }
  const float va = d3 * d6 - d5 * d4;
  if (va <= 0 && d4 - d3 >= 0 && d5 - d6 >= 0) {
    const float w = (d4 - d3) / std::max((d4 - d3) + (d5 - d6), 1e-20f);
    return done(0, 1 - w, w);
  }
  const float sum = 1 / (va + vb + vc);
  return done(va * sum, vb * sum, vc * sum);
}

// To their planes where p is above them, else to the nearest side.
Floats Body::SquaredToFaces(const FaceBlock& faces, const Vec& p) const {
  const Vecs at = Spread(p), a = Gather(at_, faces.corner[0]), b = Gather(at_, faces.corner[1]);
  const Vecs c = Gather(at_, faces.corner[2]), ab = b - a, bc = c - b, ca = a - c, n = Cross(ab, bc);
  const Vecs ap = at - a, bp = at - b, cp = at - c;
  const Ints above =
      (Dot(Cross(n, ab), ap) >= 0.0f) & (Dot(Cross(n, bc), bp) >= 0.0f) & (Dot(Cross(n, ca), cp) >= 0.0f);
  const Floats height = Dot(n, ap), squared = height * height / Higher(Dot(n, n), Floats{} + 1e-30f);
  const Floats side = Lower(SquaredToSegment(ab, ap), Lower(SquaredToSegment(bc, bp), SquaredToSegment(ca, cp)));
  return above ? squared : side;
}

void Body::Descend(const Part& part, size_t level, int32_t block, const Vec& p, Nearest* best) const {
  const Boxes& boxes = part.levels[level][block];
  const Floats squared = SquaredToBoxes(Spread(p - part.anchor), boxes.low, boxes.high);
  for (uint32_t left = Bits(squared < best->squared); left != 0; left &= Bits(squared < best->squared)) {
    const int k = Lowest(squared, left), child = kLanes * block + k;
    left &= ~(1u << k);
    if (level > 0) {
      Descend(part, level - 1, child, p, best);
      continue;
    }
    const FaceBlock& faces = part.blocks[child];
    const Floats to_faces = SquaredToFaces(faces, p);
    const int nearest = Lowest(to_faces, (1u << kLanes) - 1);
    if (to_faces[nearest] > best->squared) continue;
    if (const Nearest near = On(part, faces.face[nearest], p); near.squared < best->squared) *best = near;
  }
}

// The nearest face within kFar.
Body::Nearest Body::Search(const Part& part, const Vec& p, int32_t guess) const {
  Nearest best;
  best.squared = kFar * kFar;
  if (guess >= 0)
    if (const Nearest near = On(part, guess, p); near.squared < best.squared) best = near;
  Descend(part, part.levels.size() - 1, 0, p, &best);
  return best;
}

void Body::BeginFrame(const float* from, const float* to, const Vec& origin, float seconds) {
  ++frame_;
  per_second_ = 1 / seconds;
  for (size_t b = 0; b < at_.size(); ++b) {
    from_[b] = ToPoint(Vec{from[3 * b], from[3 * b + 1], from[3 * b + 2]} - origin);
    to_[b] = ToPoint(Vec{to[3 * b], to[3 * b + 1], to[3 * b + 2]} - origin);
  }
  for (Part& part : parts_) {
    if (part.faces.empty()) continue;
    Vec sum_from{}, sum_to{};
    for (int32_t v : part.vertices) sum_from += ToVec(from_[v]), sum_to += ToVec(to_[v]);
    const float share = 1 / static_cast<float>(part.vertices.size());
    part.anchor_from = share * sum_from, part.anchor_to = share * sum_to;
    const Vec way = part.anchor_to - part.anchor_from;
    for (Watched& watched : part.watched) {
      const Floats clear = watched.clear - part.travelled;
      watched.clear = clear > kTrusted ? clear : Floats{};
    }
    part.travel = part.travelled = 0;
    for (int32_t v : part.vertices) part.travel = std::max(part.travel, Length(ToVec(to_[v]) - ToVec(from_[v]) - way));
    if (part.blocks.empty()) Build(&part);
    Refit(&part);
  }
}

void Body::MoveTo(float t) {
  for (size_t b = 0; b < at_.size(); ++b) at_[b] = ToPoint(Mix(ToVec(from_[b]), ToVec(to_[b]), t));
  for (Part& part : parts_) {
    part.anchor = Mix(part.anchor_from, part.anchor_to, t);
    part.travelled = t * part.travel;
  }
}

Vec Body::FaceNormal(const Part& part, int32_t face) const {
  const auto& v = part.faces[face];
  const Vec a = ToVec(at_[v[0]]);
  return Cross(ToVec(at_[v[1]]) - a, ToVec(at_[v[2]]) - a);
}

bool Body::OnBorder(const Part& part, const Nearest& near) const {
  int on = 0, corner = 0, missing = 0;
  for (int k = 0; k < 3; ++k) {
    if (near.weight[k] > kOnEdge) ++on, corner = k;
    else missing = k;
  }
  if (on == 1) return part.border[part.local[part.faces[near.face][corner]]];
  return on == 2 && part.across[near.face][(missing + 1) % 3] < 0;
}

// Bærentzen and Aanæs, "Signed distance computation using the angle weighted pseudonormal", 2005.
Vec Body::PseudoNormal(const Part& part, const Nearest& near) const {
  const auto& v = part.faces[near.face];
  int on = 0, corner = 0, missing = 0;
  for (int k = 0; k < 3; ++k) {
    if (near.weight[k] > kOnEdge) ++on, corner = k;
    else missing = k;
  }
  if (on == 3) return FaceNormal(part, near.face);
  if (on == 2) {
    const int32_t other = part.across[near.face][(missing + 1) % 3];  // the edge opposite the missing corner
    Vec n = Unit(FaceNormal(part, near.face));
    if (other >= 0) n += Unit(FaceNormal(part, other));
    return n;
  }
  Vec n{};
  const int32_t local = part.local[v[corner]];
  for (int32_t j = part.around_first[local]; j < part.around_first[local + 1]; ++j) {
    const auto& g = part.faces[part.around[j]];
    const int m = g[0] == v[corner] ? 0 : g[1] == v[corner] ? 1 : 2;
    const Vec here = ToVec(at_[g[m]]), next = ToVec(at_[g[(m + 1) % 3]]), last = ToVec(at_[g[(m + 2) % 3]]);
    n += AngleAt(here, next, last) * Unit(FaceNormal(part, part.around[j]));
  }
  return n;
}

// To the nearest face from there, over edges and about corners.
Body::Nearest Body::Follow(const Part& part, const Vec& at, int32_t face) const {
  Nearest near = On(part, face, at);
  for (int walk = 0; walk < 16; ++walk) {
    const auto& v = part.faces[near.face];
    int corner = -1, on = 0;
    for (int m = 0; m < 3; ++m)
      if (near.weight[m] > kOnEdge) ++on, corner = m;
    if (on == 3) break;
    Nearest best = near;
    const auto consider = [&](int32_t other) {
      if (other < 0 || other == near.face) return;
      if (const Nearest there = On(part, other, at); there.squared < best.squared) best = there;
    };
    if (on == 1) {
      const int32_t local = part.local[v[corner]];
      for (int32_t j = part.around_first[local]; j < part.around_first[local + 1]; ++j) consider(part.around[j]);
    } else {
      for (int m = 0; m < 3; ++m)
        if (near.weight[(m + 2) % 3] <= kOnEdge) consider(part.across[near.face][m]);
    }
    if (best.face == near.face) break;
    near = best;
  }
  return near;
}

Contact Body::Touch(int32_t p, int32_t i, const Vec& at, float limit) {
  Part& part = parts_[p];
  Contact contact;
  const bool follows = part.searched[i] == frame_;
  const Nearest near = follows ? Follow(part, at, part.face[i]) : Search(part, at, part.face[i]);
  const Vec beside = at - part.anchor;
  Watched& watched = part.watched[i / kLanes];
  const int32_t lane = i % kLanes;
  watched.seen.x[lane] = beside.x, watched.seen.y[lane] = beside.y, watched.seen.z[lane] = beside.z;
  if (near.face < 0) {
    const Boxes& all = part.levels.back()[0];
    const Floats squared = SquaredToBoxes(Spread(beside), all.low, all.high);
    const float least = std::sqrt(squared[Lowest(squared, (1u << kLanes) - 1)]);
    watched.clear[lane] = std::max(kFar, least) - limit + part.travelled;
    return contact;
  }
  part.face[i] = near.face, part.searched[i] = frame_;
  const Vec away = at - near.point;
  const Vec pseudo = PseudoNormal(part, near);
  const float distance = std::sqrt(near.squared);
  const bool inside = Dot(away, pseudo) < 0;
  const float touching = inside ? kDeepest : limit;  // what is deeper, or farther, does not touch
  const float clear = follows ? std::min(distance - touching, kTrusted) : distance - touching;
  watched.clear[lane] = inside && distance <= kDeepest ? 0 : clear + part.travelled;
  if (distance >= touching || OnBorder(part, near)) return contact;
  contact.near = true;
  contact.distance = inside ? -distance : distance;
  contact.normal = distance > 1e-5f ? (inside ? -1 / distance : 1 / distance) * away : Unit(pseudo);
  const auto& v = part.faces[near.face];
  Vec velocity{};
  for (int m = 0; m < 3; ++m) velocity += near.weight[m] * (ToVec(to_[v[m]]) - ToVec(from_[v[m]]));
  contact.velocity = per_second_ * velocity;
  return contact;
}

}  // namespace cloth_solver
