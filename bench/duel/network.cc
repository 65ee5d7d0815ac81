// dcloth itself, as a host calls it.
//   level   0: the first stage alone; 1: all stages
//   contact 1: DCLOTH_OUTPUT_OUTSIDE_BODY
//   spread  1: DCLOTH_FRAME_PIPELINED, so that no frame pays for a whole tick
#include <stdexcept>
#include <string>

#include "bench/duel/method.h"
#include "converter/stages.h"
#include "tools/playback.h"

namespace dcloth::duel {
namespace {

class Network : public Method {
 public:
  Network(const std::filesystem::path& path, const Options& options, const std::vector<std::string>& joints)
      : model_(tools::OpenModelFile(path)),
        player_(model_, options.Get("level", 1) > 0 ? model_.info().stages : uint32_t{DCLOTH_STAGES_STATIC},
                path.string(), {.flags = options.Get("contact", 1) > 0 ? uint32_t{DCLOTH_OUTPUT_OUTSIDE_BODY} : 0U}),
        flags_(options.Get("spread", 1) > 0 ? uint32_t{DCLOTH_FRAME_PIPELINED} : 0U) {
    std::vector<const char*> names;
    for (const std::string& joint : joints) names.push_back(joint.c_str());
    if (dcloth_cloth_bind_joints(model_.cloth(), names.data(), static_cast<uint32_t>(names.size()), nullptr) !=
        DCLOTH_OK)
      throw std::runtime_error(path.string() + ": the clip lacks joints of this model");
  }

  void Start(Pose, std::span<const float>) override { player_.Reset(); }
  void Frame(Pose pose, float seconds, bool jumped) override {
    player_.Update(pose, seconds, flags_ | (jumped ? uint32_t{DCLOTH_FRAME_JUMPED} : 0U), true);
  }
  std::span<const float> positions() const override { return player_.positions(); }
  size_t instance_bytes() const override { return model_.instance_bytes(); }
  size_t shared_bytes() const override { return model_.bytes().size(); }

 private:
  converter::OpenModel model_;
  tools::Player player_;
  uint32_t flags_;
};

}  // namespace

std::unique_ptr<Method> MakeNetwork(const std::filesystem::path& model, const Options& options,
                                    const std::vector<std::string>& joints) {
  return std::make_unique<Network>(model, options, joints);
}

}  // namespace dcloth::duel
