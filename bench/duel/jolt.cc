// Jolt's soft body on the proxy, its host the only thread: SoftBodyMotionProperties::CustomUpdate after the figure
// moved.
//   iterations        Jolt's steps inside an update
//   compliance, bias  m/N: of edges along the threads, and of those at 45 degrees to them
//   bend              rad/(N m): of the dihedral constraints, whose rest angles the hung garment has; < 0: none
//   damping           1/s
//   radius            m: of a vertex
//   friction
//   tether            long-range attachment: its length over the way along the cloth; 0: none
//   follow            share of the hips' way that the cloth is carried along (engines say 1 - it: world velocity scale)
//
// The figure's capsules are dynamic bodies of great mass that the host moves: against kinematic ones, 5.0 takes
// friction and contact velocity relative to the world, and a walking figure would leave its skirt behind.
// clang-format off: Jolt.h comes before all others of Jolt.
#include <Jolt/Jolt.h>
// clang-format on
#include <Jolt/Core/Factory.h>
#include <Jolt/Core/TempAllocator.h>
#include <Jolt/Physics/Body/BodyCreationSettings.h>
#include <Jolt/Physics/Collision/Shape/SphereShape.h>
#include <Jolt/Physics/Collision/Shape/TaperedCapsuleShape.h>
#include <Jolt/Physics/PhysicsSystem.h>
#include <Jolt/Physics/SoftBody/SoftBodyCreationSettings.h>
#include <Jolt/Physics/SoftBody/SoftBodyMotionProperties.h>
#include <Jolt/RegisterTypes.h>

#include <algorithm>

#include "bench/duel/drawn.h"
#include "bench/duel/method.h"

namespace dcloth::duel {
namespace {

constexpr JPH::ObjectLayer kLayer{0};

class OneLayer : public JPH::BroadPhaseLayerInterface {
 public:
  JPH::uint GetNumBroadPhaseLayers() const override { return 1; }
  JPH::BroadPhaseLayer GetBroadPhaseLayer(JPH::ObjectLayer) const override { return JPH::BroadPhaseLayer(0); }
};

// A world to itself, so that contestants do not meet.
struct World {
  World() {
    static const bool kReady = [] {
      JPH::RegisterDefaultAllocator();
      JPH::Factory::sInstance = new JPH::Factory;
      JPH::RegisterTypes();
      return true;
    }();
    system = kReady ? std::make_unique<JPH::PhysicsSystem>() : nullptr;
    system->Init(64, 0, 64, 64, layers, against_layers, pairs);
    system->SetGravity({0, -9.81F, 0});
  }
  OneLayer layers;
  JPH::ObjectVsBroadPhaseLayerFilter against_layers;
  JPH::ObjectLayerPairFilter pairs;
  std::unique_ptr<JPH::PhysicsSystem> system;
};

JPH::Vec3 HipsOf(Pose pose) { return {pose[3], pose[7], pose[11]}; }
JPH::Mat44 MatrixOf(const Columns& m) {
  const auto column = [](Four a, float w) { return JPH::Vec4(a[0], a[1], a[2], w); };
  return {column(m[0], 0), column(m[1], 0), column(m[2], 0), column(m[3], 1)};
}

class Jolt : public Method {
 public:
  Jolt(const Case& data, const Options& options)
      : drawn_(data),
        bind_(data.Get<float>("bind")),
        capsules_(data.Get<float>("capsules")),
        pins_(data.Get<int32_t>("proxy.pins")),
        nearest_(data.Get<int32_t>("draw.nearest")),
        capsule_joints_(data.Get<int32_t>("capsule_joints")),
        rest_(data.Get<float>("proxy.positions")),
        skin_(data.Rows("bind")),
        band_target_(3 * pins_.size()),
        proxy_(rest_.size() / 3),
        iterations_(static_cast<JPH::uint32>(options.Get("iterations", 4))),
        damping_(options.Get("damping", 0.5)),
        friction_(options.Get("friction", 0.2)),
        follow_(options.Get("follow", 0.5)) {
    std::vector<float> pinned;
    for (int32_t pin : pins_) pinned.insert(pinned.end(), &rest_[3 * pin], &rest_[3 * pin] + 3);
    band_ = Skinned(std::move(pinned), data.Get<float>("proxy.pin_weights"), skin_.size());
    Sew(data, options);
  }
  ~Jolt() override { Leave(); }

  void Start(Pose pose, std::span<const float> truth) override {
    Leave();
    SkinMatrices(pose, bind_, skin_);
    band_.Run(skin_, band_target_.data());
    JPH::BodyInterface& bodies = world_.system->GetBodyInterfaceNoLock();
    for (size_t k = 0; k < capsule_joints_.size(); ++k) {
      const float* c = &capsules_[8 * k];
      const JPH::Vec3 a(c[0], c[1], c[2]), b(c[3], c[4], c[5]), along = b - a;
      const float length = along.Length();
      JPH::ShapeSettings::ShapeResult shape;
      // Jolt has spheres where one end's sphere holds the other's.
      if (length <= std::abs(c[6] - c[7]) + 1e-4F)
        shape = JPH::SphereShapeSettings(std::max(c[6], c[7])).Create();
      else
        shape = JPH::TaperedCapsuleShapeSettings(0.5F * length, c[7], c[6]).Create();
      const JPH::Vec3 centre =
          shape.Get()->GetSubType() == JPH::EShapeSubType::Sphere ? (c[6] > c[7] ? a : b) : 0.5F * (a + b);
      bind_places_.push_back(JPH::Mat44::sRotationTranslation(
          JPH::Quat::sFromTo(JPH::Vec3::sAxisY(), along.NormalizedOr(JPH::Vec3::sAxisY())), centre));
      const JPH::Mat44 place = MatrixOf(skin_[capsule_joints_[k]]) * bind_places_.back();
      JPH::BodyCreationSettings limb(shape.Get(), place.GetTranslation(), place.GetQuaternion().Normalized(),
                                     JPH::EMotionType::Dynamic, kLayer);
      limb.mOverrideMassProperties = JPH::EOverrideMassProperties::CalculateInertia;
      limb.mMassPropertiesOverride.mMass = 1e7F;
      limb.mFriction = friction_;
      limbs_.push_back(bodies.CreateAndAddBody(limb, JPH::EActivation::DontActivate));
      places_.push_back(place);
    }
    hips_ = HipsOf(pose);
    const JPH::Vec3 middle = hips_;
    JPH::SoftBodyCreationSettings settings(cloth_, middle, JPH::Quat::sIdentity(), kLayer);
    settings.mNumIterations = iterations_, settings.mLinearDamping = damping_, settings.mFriction = friction_;
    settings.mAllowSleeping = false;
    body_ = bodies.CreateSoftBody(settings);
    bodies.AddBody(body_->GetID(), JPH::EActivation::Activate);
    auto& vertices = Properties().GetVertices();
    for (size_t i = 0; i < proxy_.size(); ++i) {
      const float* at = &truth[3 * nearest_[i]];
      vertices[i].mPosition = JPH::Vec3(at[0], at[1], at[2]) - middle;
    }
    for (size_t k = 0; k < pins_.size(); ++k) vertices[pins_[k]].mPosition = Target(k) - middle;
    for (auto& v : vertices) v.mPreviousPosition = v.mPosition, v.mVelocity = JPH::Vec3::sZero();
  }

  void Frame(Pose pose, float seconds, bool) override {
    const int steps = Steps(seconds);
    const float dt = seconds / static_cast<float>(steps);
    SkinMatrices(pose, bind_, skin_);
    band_.Run(skin_, band_target_.data());
    from_ = places_;
    const JPH::Vec3 hips = HipsOf(pose), way = follow_ / static_cast<float>(steps) * (hips - hips_);
    hips_ = hips;
    JPH::BodyInterface& bodies = world_.system->GetBodyInterfaceNoLock();
    for (int step = 0; step < steps; ++step) {
      bodies.SetPosition(body_->GetID(), body_->GetPosition() + way, JPH::EActivation::DontActivate);
      Move(static_cast<float>(step + 1) / static_cast<float>(steps), dt, way);
      const JPH::Vec3 origin = body_->GetPosition();
      auto& vertices = Properties().GetVertices();
      for (size_t k = 0; k < pins_.size(); ++k) {  // straight to where it is due at the end of the frame
        auto& v = vertices[pins_[k]];
        v.mVelocity = (Target(k) - origin - v.mPosition) / (dt * static_cast<float>(steps - step));
      }
      Properties().CustomUpdate(dt, *body_, *world_.system);
    }
    const JPH::Vec3 origin = body_->GetPosition();
    const auto& vertices = Properties().GetVertices();
    for (size_t i = 0; i < proxy_.size(); ++i) {
      const JPH::Vec3 at = origin + vertices[i].mPosition;
      proxy_[i] = Four{at.GetX(), at.GetY(), at.GetZ(), 0};
    }
    drawn_.FollowProxy(proxy_);
  }
  std::span<const float> positions() const override { return drawn_.positions(); }
  size_t instance_bytes() const override {
    return sizeof(JPH::Body) * (1 + limbs_.size()) + sizeof(JPH::SoftBodyMotionProperties) +
           proxy_.size() * (sizeof(JPH::SoftBodyVertex) + sizeof(Four)) +
           limbs_.size() * sizeof(JPH::MotionProperties) + 6 * drawn_.vertices() * sizeof(float);
  }
  size_t shared_bytes() const override {
    using Of = JPH::SoftBodySharedSettings;
    return drawn_.bytes() + cloth_->mVertices.size() * sizeof(Of::Vertex) + cloth_->mFaces.size() * sizeof(Of::Face) +
           cloth_->mEdgeConstraints.size() * sizeof(Of::Edge) + cloth_->mLRAConstraints.size() * sizeof(Of::LRA) +
           cloth_->mDihedralBendConstraints.size() * sizeof(Of::DihedralBend);
  }

 private:
  JPH::SoftBodyMotionProperties& Properties() {
    return *static_cast<JPH::SoftBodyMotionProperties*>(body_->GetMotionProperties());
  }
  JPH::Vec3 Target(size_t k) const { return {band_target_[3 * k], band_target_[3 * k + 1], band_target_[3 * k + 2]}; }

  // Vertices, masses, edges with their lengths in the pattern, bending, tethers.
  void Sew(const Case& data, const Options& options) {
    const auto faces = data.Get<int32_t>("proxy.faces"), edges = data.Get<int32_t>("proxy.edges");
    const auto pattern = data.Get<float>("proxy.pattern"), lengths = data.Get<float>("proxy.rest_length"),
               scale = data.Get<float>("proxy.mass_scale");
    const float density = data.Get<float>("solver.settings")[4];
    std::vector<float> mass(proxy_.size(), 1e-9F);
    std::map<std::pair<int32_t, int32_t>, std::pair<float, float>> cut;  // edge -> length, share of the bias
    cloth_ = new JPH::SoftBodySharedSettings;
    for (size_t f = 0; f < faces.size(); f += 3) {
      const float* p = &pattern[2 * f];
      const float area = 0.5F * std::abs((p[2] - p[0]) * (p[5] - p[1]) - (p[3] - p[1]) * (p[4] - p[0]));
      for (int k = 0; k < 3; ++k) {
        mass[faces[f + k]] += density * scale[faces[f + k]] * area / 3;
        const int32_t a = faces[f + k], b = faces[f + (k + 1) % 3], next = 2 * ((k + 1) % 3);
        const float dx = p[next] - p[2 * k], dy = p[next + 1] - p[2 * k + 1];
        const float sine = 2 * dx * dy / std::max(dx * dx + dy * dy, 1e-12F);
        cut[std::minmax(a, b)].second = sine * sine;
      }
      cloth_->AddFace({static_cast<JPH::uint32>(faces[f]), static_cast<JPH::uint32>(faces[f + 1]),
                       static_cast<JPH::uint32>(faces[f + 2])});
    }
    for (size_t e = 0; e < lengths.size(); ++e) cut[std::minmax(edges[2 * e], edges[2 * e + 1])].first = lengths[e];
    for (size_t i = 0; i < proxy_.size(); ++i)
      cloth_->mVertices.push_back({{rest_[3 * i], rest_[3 * i + 1], rest_[3 * i + 2]}, {0, 0, 0}, 1 / mass[i]});
    for (int32_t pin : pins_) cloth_->mVertices[pin].mInvMass = 0;
    const float bend = options.Get("bend", 1e4), tether = options.Get("tether", 1.02);
    using Of = JPH::SoftBodySharedSettings;
    const Of::VertexAttributes fabric(0, 0, bend < 0 ? FLT_MAX : bend,
                                      tether > 0 ? Of::ELRAType::GeodesicDistance : Of::ELRAType::None, tether);
    cloth_->CreateConstraints(&fabric, 1, bend < 0 ? Of::EBendType::None : Of::EBendType::Dihedral);
    // Jolt ties quads across, too: cloth shears, so those go.
    const float along = options.Get("compliance", 0), askew = options.Get("bias", 1e-3);
    JPH::Array<Of::Edge> sewn;
    for (Of::Edge edge : cloth_->mEdgeConstraints) {
      const auto found = cut.find(
          {std::min<int32_t>(edge.mVertex[0], edge.mVertex[1]), std::max<int32_t>(edge.mVertex[0], edge.mVertex[1])});
      if (found == cut.end()) continue;
      edge.mRestLength = found->second.first, edge.mCompliance = along + found->second.second * (askew - along);
      sewn.push_back(edge);
    }
    cloth_->mEdgeConstraints = sewn;
    cloth_->mVertexRadius = options.Get("radius", 0.006);
    cloth_->Optimize();
  }

  // The capsules' places and velocities, part of the way from the last frame's to this one's.
  void Move(float t, float dt, JPH::Vec3Arg way) {
    JPH::BodyInterface& bodies = world_.system->GetBodyInterfaceNoLock();
    for (size_t k = 0; k < limbs_.size(); ++k) {
      const JPH::Mat44 to = MatrixOf(skin_[capsule_joints_[k]]) * bind_places_[k];
      const JPH::Vec3 at = from_[k].GetTranslation() + t * (to.GetTranslation() - from_[k].GetTranslation());
      const JPH::Quat turn = from_[k].GetQuaternion().Normalized().SLERP(to.GetQuaternion().Normalized(), t);
      const JPH::Vec3 velocity = (at - places_[k].GetTranslation() - way) / dt;
      JPH::Vec3 axis;
      float angle;
      (turn * places_[k].GetQuaternion().Conjugated()).GetAxisAngle(axis, angle);
      if (angle > JPH::JPH_PI) angle -= 2 * JPH::JPH_PI;
      bodies.SetPositionRotationAndVelocity(limbs_[k], at, turn, velocity, axis * (angle / dt));
      places_[k] = JPH::Mat44::sRotationTranslation(turn, at);
    }
  }

  void Leave() {
    JPH::BodyInterface& bodies = world_.system->GetBodyInterfaceNoLock();
    if (body_ != nullptr) limbs_.push_back(body_->GetID());
    for (const JPH::BodyID& id : limbs_) bodies.RemoveBody(id), bodies.DestroyBody(id);
    body_ = nullptr;
    limbs_.clear(), places_.clear(), bind_places_.clear();
  }

  World world_;  // before Jolt's other objects
  Drawn drawn_;
  std::vector<float> bind_, capsules_;
  std::vector<int32_t> pins_, nearest_, capsule_joints_;
  std::vector<float> rest_;
  std::vector<Columns> skin_;
  std::vector<float> band_target_;
  std::vector<Four> proxy_;
  JPH::uint32 iterations_;
  float damping_, friction_, follow_;
  JPH::Vec3 hips_ = JPH::Vec3::sZero();
  Skinned band_;
  JPH::Ref<JPH::SoftBodySharedSettings> cloth_;
  std::vector<JPH::BodyID> limbs_;
  std::vector<JPH::Mat44> bind_places_, places_, from_;
  JPH::Body* body_ = nullptr;
};

}  // namespace

std::unique_ptr<Method> MakeJolt(const Case& data, const Options& options) {
  return std::make_unique<Jolt>(data, options);
}

}  // namespace dcloth::duel
