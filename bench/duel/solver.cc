// The training solver on the proxy and a skin of fewer triangles.
//   steps, passes  a 60 Hz frame's small steps, and passes over the springs in each
//   layers         1: contact between layers of cloth
//   stretch, bias, bend, damping: times those of the garment's fabric; hz: frames a second
#include "training/cloth_solver/solver.h"

#include "bench/duel/drawn.h"
#include "bench/duel/method.h"
#include "training/cloth_solver/order.h"

namespace dcloth::duel {
namespace {

class Simulation : public Method {
 public:
  Simulation(const Case& data, const Options& options)
      : drawn_(data),
        bind_(data.Get<float>("bind")),
        positions_(data.Get<float>("proxy.positions")),
        pattern_(data.Get<float>("proxy.pattern")),
        mass_scale_(data.Get<float>("proxy.mass_scale")),
        bend_scale_(data.Get<float>("proxy.bend_scale")),
        crease_(data.Get<float>("proxy.crease")),
        faces_(data.Get<int32_t>("proxy.faces")),
        pins_(data.Get<int32_t>("proxy.pins")),
        nearest_(data.Get<int32_t>("draw.nearest")),
        body_faces_(data.Get<int32_t>("body.faces")),
        body_part_(data.Get<int32_t>("body.part")),
        skin_(data.Rows("bind")),
        body_(data.Get<float>("body.positions"), data.Get<float>("body.weights"), skin_.size()),
        proxy_(data.Rows("proxy.positions")) {
    for (int32_t mask : data.Get<int32_t>("proxy.touches")) touches_.push_back(static_cast<uint32_t>(mask));
    std::vector<float> pinned;
    for (int32_t pin : pins_) pinned.insert(pinned.end(), &positions_[3 * pin], &positions_[3 * pin] + 3);
    band_ = Skinned(std::move(pinned), data.Get<float>("proxy.pin_weights"), skin_.size());
    body_path_.resize(2 * 3 * data.Rows("body.positions"));
    pin_path_.resize(2 * 3 * pins_.size());
    const std::vector<float> s = data.Get<float>("solver.settings");
    const float frame = 1 / options.Get("hz", 60);
    settings_ = {static_cast<int32_t>(options.Get("steps", 4)),
                 static_cast<int32_t>(options.Get("passes", 2)),
                 frame / static_cast<float>(Steps(frame)),
                 s[3],
                 s[4],
                 s[5] * options.Get("stretch", 1),
                 s[6] * options.Get("bias", 1),
                 s[7],
                 s[8] * options.Get("bend", 1),
                 s[9] * options.Get("damping", 1),
                 s[10],
                 s[11],
                 s[12],
                 s[13],
                 s[14],
                 s[15] * options.Get("layers", 0),
                 s[16],
                 s[17]};
  }

  void Start(Pose pose, std::span<const float> truth) override {
    Posed(pose);
    Keep();
    std::vector<float> start(positions_.size());
    for (size_t i = 0; i < proxy_.size(); ++i)
      for (int axis = 0; axis < 3; ++axis) start[3 * i + axis] = truth[3 * nearest_[i] + axis];
    for (size_t k = 0; k < pins_.size(); ++k) std::copy_n(&pin_path_[3 * k], 3, &start[3 * pins_[k]]);
    const auto count = [](size_t n) { return static_cast<int32_t>(n); };
    problem_ = {count(proxy_.size()),
                count(faces_.size() / 3),
                count(pins_.size()),
                count(body_path_.size() / 6),
                count(body_part_.size()),
                1 + *std::max_element(body_part_.begin(), body_part_.end()),
                2,
                start.data(),
                faces_.data(),
                pattern_.data(),
                mass_scale_.data(),
                bend_scale_.data(),
                crease_.data(),
                pins_.data(),
                pin_path_.data(),
                body_faces_.data(),
                body_part_.data(),
                body_path_.data(),
                touches_.data(),
                origin_,
                nullptr,
                settings_};
    ordered_ = std::make_unique<cloth_solver::Ordered>(problem_);
    solver_ = std::make_unique<cloth_solver::Solver>(ordered_->problem());
  }

  // A longer frame is several of the solver's own; its body moves straight between the two poses.
  void Frame(Pose pose, float seconds, bool) override {
    const int steps = Steps(seconds);
    Posed(pose);
    if (steps > 1) whole_[0] = body_path_, whole_[1] = pin_path_, whole_[2].assign(origin_, origin_ + 6);
    for (int step = 0; step < steps; ++step) {
      if (steps > 1) {
        Part(whole_[0], step, steps, body_path_.data());
        Part(whole_[1], step, steps, pin_path_.data());
        Part(whole_[2], step, steps, origin_);
      }
      solver_->Frame(1);
    }
    Keep();
    solver_->Write(ordered_->given(), positions_.data());
    for (size_t i = 0; i < proxy_.size(); ++i)
      proxy_[i] = Four{positions_[3 * i], positions_[3 * i + 1], positions_[3 * i + 2], 0};
    drawn_.FollowProxy(proxy_);
  }
  std::span<const float> positions() const override { return drawn_.positions(); }
  // Springs and hinges hold masses and lengths that all characters could share; the solver keeps a copy each.
  size_t instance_bytes() const override {
    return 5 * proxy_.size() * 16 + 3 * faces_.size() / 2 * 48 + 3 * faces_.size() / 2 * 64 + 4 * body_path_.size() +
           6 * drawn_.vertices() * sizeof(float);
  }
  size_t shared_bytes() const override { return drawn_.bytes() + body_.bytes() + 4 * body_faces_.size(); }

 private:
  // Body, pins and hips of the pose, as the second of two frames.
  void Posed(Pose pose) {
    SkinMatrices(pose, bind_, skin_);
    body_.Run(skin_, &body_path_[body_path_.size() / 2]);
    band_.Run(skin_, &pin_path_[pin_path_.size() / 2]);
    for (int axis = 0; axis < 3; ++axis) origin_[3 + axis] = pose[4 * axis + 3];
  }
  void Keep() {
    std::copy_n(&body_path_[body_path_.size() / 2], body_path_.size() / 2, body_path_.data());
    std::copy_n(&pin_path_[pin_path_.size() / 2], pin_path_.size() / 2, pin_path_.data());
    std::copy_n(origin_ + 3, 3, origin_);
  }
  static void Part(const std::vector<float>& whole, int step, int steps, float* path) {
    const size_t half = whole.size() / 2;
    for (int end = 0; end < 2; ++end) {
      const float t = static_cast<float>(step + end) / static_cast<float>(steps);
      for (size_t i = 0; i < half; ++i) path[end * half + i] = whole[i] + t * (whole[half + i] - whole[i]);
    }
  }

  Drawn drawn_;
  std::vector<float> bind_, positions_, pattern_, mass_scale_, bend_scale_, crease_;
  std::vector<int32_t> faces_, pins_, nearest_, body_faces_, body_part_;
  std::vector<uint32_t> touches_;
  std::vector<Columns> skin_;
  Skinned body_, band_;
  std::vector<Four> proxy_;
  std::vector<float> body_path_, pin_path_, whole_[3];  // [2, .., 3]
  float origin_[6] = {};
  cloth_solver_settings settings_{};
  cloth_solver_problem problem_{};
  std::unique_ptr<cloth_solver::Ordered> ordered_;
  std::unique_ptr<cloth_solver::Solver> solver_;
};

}  // namespace

std::unique_ptr<Method> MakeSolver(const Case& data, const Options& options) {
  return std::make_unique<Simulation>(data, options);
}

}  // namespace dcloth::duel
