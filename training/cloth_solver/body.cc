#include "body.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

namespace cloth_solver {
namespace {

constexpr int32_t kLeaf = 4;
constexpr float kDeepest = 0.03f;  // m: cloth sinks by millimetres in a step; what is deeper looks into an open end
constexpr float kOnEdge = 1e-4f;  // barycentric weight below which the nearest point counts as on the edge

Vec Low(const Vec& a, const Vec& b) { return {std::min(a.x, b.x), std::min(a.y, b.y), std::min(a.z, b.z)}; }
Vec High(const Vec& a, const Vec& b) { return {std::max(a.x, b.x), std::max(a.y, b.y), std::max(a.z, b.z)}; }

float SquaredToBox(const Vec& p, const Vec& low, const Vec& high) {
  const float x = std::max({low.x - p.x, 0.0f, p.x - high.x}), y = std::max({low.y - p.y, 0.0f, p.y - high.y}),
              z = std::max({low.z - p.z, 0.0f, p.z - high.z});
  return x * x + y * y + z * z;
}

float AngleAt(const Vec& a, const Vec& b, const Vec& c) {
  const Vec u = Unit(b - a), v = Unit(c - a);
  return std::acos(std::clamp(Dot(u, v), -1.0f, 1.0f));
}

}  // namespace

Body::Body(int32_t vertices, int32_t faces, const int32_t* face, const int32_t* part, int32_t parts,
           std::vector<uint32_t> touches, int32_t cloth_vertices)
    : parts_(parts), touches_(std::move(touches)), last_face_(parts, std::vector<int32_t>(cloth_vertices, -1)) {
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
  }
}

void Body::Build(Part* part) {
  part->order.resize(part->faces.size());
  std::iota(part->order.begin(), part->order.end(), 0);
  part->nodes.assign(1, {{}, {}, 0, static_cast<int32_t>(part->order.size())});
  const auto centre = [&](int32_t f) {
    const auto& v = part->faces[f];
    return from_[v[0]] + from_[v[1]] + from_[v[2]];
  };
  for (size_t n = 0; n < part->nodes.size(); ++n) {
    const int32_t first = part->nodes[n].first, count = part->nodes[n].count;
    if (count <= kLeaf) continue;
    Vec low{1e9f, 1e9f, 1e9f}, high{-1e9f, -1e9f, -1e9f};
    for (int32_t i = first; i < first + count; ++i) {
      const Vec c = centre(part->order[i]);
      low = Low(low, c), high = High(high, c);
    }
    const Vec size = high - low;
    float Vec::*axis = size.x >= size.y && size.x >= size.z ? &Vec::x : size.y >= size.z ? &Vec::y : &Vec::z;
    std::sort(part->order.begin() + first, part->order.begin() + first + count, [&](int32_t f, int32_t g) {
      const float a = centre(f).*axis, b = centre(g).*axis;
      return a != b ? a < b : f < g;
    });
    const int32_t child = static_cast<int32_t>(part->nodes.size());
    part->nodes.push_back({{}, {}, first, count / 2});
    part->nodes.push_back({{}, {}, first + count / 2, count - count / 2});
    part->nodes[n].first = child, part->nodes[n].count = 0;
  }
}

void Body::Refit(Part* part) {
  for (size_t n = part->nodes.size(); n-- > 0;) {
    Node& node = part->nodes[n];
    if (node.count == 0) {
      node.low = Low(part->nodes[node.first].low, part->nodes[node.first + 1].low);
      node.high = High(part->nodes[node.first].high, part->nodes[node.first + 1].high);
      continue;
    }
    node.low = {1e9f, 1e9f, 1e9f}, node.high = {-1e9f, -1e9f, -1e9f};
    for (int32_t i = node.first; i < node.first + node.count; ++i)
      for (int32_t v : part->faces[part->order[i]]) {
        node.low = Low(node.low, from_[v]), node.high = High(node.high, from_[v]);
      }
  }
}

// Ericson, "Real-time collision detection", 5.1.5: nearest point of a triangle with its barycentric weights.
Body::Nearest Body::On(const std::vector<Vec>& at, const Part& part, int32_t face, const Vec& p) {
  const auto& v = part.faces[face];
  const Vec &a = at[v[0]], &b = at[v[1]], &c = at[v[2]];
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

Body::Nearest Body::Search(const Part& part, const Vec& p, float reach, int32_t guess) const {
  Nearest best;
  best.squared = reach * reach;
  if (guess >= 0)
    if (const Nearest near = On(from_, part, guess, p); near.squared < best.squared) best = near;
  int32_t stack[64], depth = 0;
  stack[depth++] = 0;
  while (depth > 0) {
    const Node& node = part.nodes[stack[--depth]];
    if (SquaredToBox(p, node.low, node.high) >= best.squared) continue;
    if (node.count == 0) {
      const float a = SquaredToBox(p, part.nodes[node.first].low, part.nodes[node.first].high);
      const float b = SquaredToBox(p, part.nodes[node.first + 1].low, part.nodes[node.first + 1].high);
      stack[depth++] = node.first + (a < b ? 1 : 0);
      stack[depth++] = node.first + (a < b ? 0 : 1);
      continue;
    }
    for (int32_t i = node.first; i < node.first + node.count; ++i)
      if (const Nearest near = On(from_, part, part.order[i], p); near.squared < best.squared) best = near;
  }
  return best;
}

void Body::BeginFrame(std::vector<Vec> from, std::vector<Vec> to, float seconds, const std::vector<Vec>& cloth,
                      float cloth_travel, float reach) {
  from_ = std::move(from), to_ = std::move(to);
  at_ = from_, t_ = 0;
  per_second_ = 1 / seconds;
  for (size_t p = 0; p < parts_.size(); ++p) {
    Part& part = parts_[p];
    if (part.faces.empty()) continue;
    if (part.nodes.empty()) Build(&part);
    Refit(&part);
    float travel = 0;
    for (int32_t v : part.vertices) travel = std::max(travel, Length(to_[v] - from_[v]));
    part.step_travel = travel;  // of the whole frame: MoveTo takes its share
    const float all = reach + travel + cloth_travel;
    part.candidates.clear(), part.face.clear(), part.seen_at.clear(), part.clear.clear();
    for (int32_t i = 0; i < static_cast<int32_t>(cloth.size()); ++i) {
      if (!touches_.empty() && !(touches_[i] >> p & 1)) continue;
      if (SquaredToBox(cloth[i], part.nodes[0].low, part.nodes[0].high) > all * all) continue;
      const Nearest near = Search(part, cloth[i], all, last_face_[p][i]);
      if (near.face < 0) continue;
      last_face_[p][i] = near.face;
      part.candidates.push_back(i);
      part.face.push_back(near.face);
      part.seen_at.push_back(cloth[i]);
      part.clear.push_back(0);
    }
  }
}

void Body::MoveTo(float t) {
  for (size_t b = 0; b < at_.size(); ++b) at_[b] = Mix(from_[b], to_[b], t);
  for (Part& part : parts_)
    for (float& clear : part.clear) clear -= (t - t_) * part.step_travel;
  t_ = t;
}

Vec Body::FaceNormal(const Part& part, int32_t face) const {
  const auto& v = part.faces[face];
  return Cross(at_[v[1]] - at_[v[0]], at_[v[2]] - at_[v[0]]);
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
    n += AngleAt(at_[g[m]], at_[g[(m + 1) % 3]], at_[g[(m + 2) % 3]]) * Unit(FaceNormal(part, part.around[j]));
  }
  return n;
}

Contact Body::Touch(int32_t p, int32_t k, const Vec& at, float limit) {
  Part& part = parts_[p];
  Contact contact;
  const Vec moved = at - part.seen_at[k];
  if (part.clear[k] > 0 && part.clear[k] * part.clear[k] > Dot(moved, moved)) return contact;
  Nearest near = On(at_, part, part.face[k], at);
  for (int walk = 0; walk < 16; ++walk) {  // to the nearest face from there, over edges and about corners
    const auto& v = part.faces[near.face];
    int corner = -1, on = 0;
    for (int m = 0; m < 3; ++m)
      if (near.weight[m] > kOnEdge) ++on, corner = m;
    if (on == 3) break;
    Nearest best = near;
    const auto consider = [&](int32_t face) {
      if (face < 0 || face == near.face) return;
      if (const Nearest there = On(at_, part, face, at); there.squared < best.squared) best = there;
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
  part.face[k] = near.face;
  last_face_[p][part.candidates[k]] = near.face;
  part.seen_at[k] = at;
  part.clear[k] = 0;
  if (OnBorder(part, near)) return contact;
  const Vec away = at - near.point;
  const Vec pseudo = PseudoNormal(part, near);
  const float distance = std::sqrt(near.squared);
  const bool inside = Dot(away, pseudo) < 0;
  part.clear[k] = inside ? 0 : distance - limit;
  if (inside ? distance > kDeepest : distance >= limit) return contact;
  contact.near = true;
  contact.distance = inside ? -distance : distance;
  contact.normal = distance > 1e-5f ? (inside ? -1 / distance : 1 / distance) * away : Unit(pseudo);
  const auto& v = part.faces[near.face];
  Vec velocity{};
  for (int m = 0; m < 3; ++m) velocity += near.weight[m] * (to_[v[m]] - from_[v[m]]);
  contact.velocity = per_second_ * velocity;
  return contact;
}

}  // namespace cloth_solver
