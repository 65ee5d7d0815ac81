// `dcloth inspect`: what a model file holds, without running it.
#include <cstdio>
#include <filesystem>
#include <memory>

#include "converter/error.h"
#include "converter/model_work.h"
#include "tools/commands.h"
#include "tools/json_output.h"
#include "tools/playback.h"

namespace dcloth::tools {
namespace {

struct Options {
  std::filesystem::path model;
  bool json = false;
};

// Null where the file does not tell.
Json JointParents(const converter::OpenModel& model) {
  Json parents = Json::array();
  for (uint32_t j = 0; j < model.info().joint_count; ++j) {
    const int32_t parent = dcloth_model_joint_parent(model.model(), j);
    if (parent == DCLOTH_JOINT_UNKNOWN) return nullptr;
    parents.push_back(parent);
  }
  return parents;
}

// Of all stages.
uint64_t TickMultiplyAdds(const converter::ModelWork& work) {
  uint64_t flops = 0;
  for (size_t part = 0; part < format::kTickPartCount; ++part) flops += work[part].flops;
  return flops / 2;
}

// Null where the model has the paper's stages.
Json Patches(const converter::OpenModel& model, const converter::ModelWork& work) {
  using converter::WorkPart;
  const converter::PatchSizes sizes = converter::PatchSizesOf(model.bytes());
  if (sizes.patches == 0) return nullptr;
  uint64_t bytes = 0;
  for (const WorkPart part : {WorkPart::kPatchInputs, WorkPart::kPatchLayers, WorkPart::kPatchMap})
    bytes += work[static_cast<size_t>(part)].weight_bytes;
  return {{"patches", sizes.patches},
          {"points", sizes.points},
          {"width", sizes.width},
          {"sources", sizes.sources},
          {"weight_bytes", bytes}};
}

Json Describe(const converter::OpenModel& model, const Options& options) {
  const converter::ModelWork work = converter::CountWork(model.bytes());
  const dcloth_model_info& info = model.info();
  Json stages = Json::array();
  for (uint32_t s : {DCLOTH_STAGES_STATIC, DCLOTH_STAGES_SKELETON, DCLOTH_STAGES_MESH}) {
    if ((s & ~info.stages) == 0) stages.push_back(StagesName(s));
  }
  return {{"path", converter::PathText(options.model)},
          {"garment", info.name},
          {"precision", info.precision},
          {"format", std::to_string(info.format_major) + "." + std::to_string(info.format_minor)},
          {"model_bytes", model.bytes().size()},
          {"instance_bytes", model.instance_bytes()},
          {"model_view_bytes", dcloth_model_storage_size()},
          {"tick_rate", TickRate(model)},
          {"vertices", info.vertex_count},
          {"triangles", info.triangle_count},
          {"coarse_vertices", info.coarse_vertex_count},
          {"coarse_triangles", info.coarse_triangle_count},
          {"textured_vertices", info.textured_vertex_count},
          {"stages", stages},
          {"patches", Patches(model, work)},
          {"tick_multiply_adds", TickMultiplyAdds(work)},
          {"joints", model.joint_names()},
          {"joint_parents", JointParents(model)}};
}

int Inspect(const Options& options) {
  const converter::OpenModel model = OpenModelFile(options.model);
  const Json json = Describe(model, options);
  if (options.json) {
    PrintJson(json);
    return kExitGood;
  }
  const auto text = [&](const char* key) { return converter::PrintableText(json[key].get<std::string>()); };
  std::printf("%s\n", text("path").c_str());
  std::printf("  garment    %s, %u vertices, %u triangles\n", text("garment").c_str(), model.info().vertex_count,
              model.info().triangle_count);
  if (model.info().coarse_vertex_count != 0) {
    std::printf("  coarse     %u vertices, %u triangles, for characters far away\n", model.info().coarse_vertex_count,
                model.info().coarse_triangle_count);
  }
  if (model.info().textured_vertex_count != 0) {
    std::printf("  texture    %u vertices, %u of them repeated at seams\n", model.info().textured_vertex_count,
                model.info().seam_vertex_count);
  }
  std::printf("  precision  %s, format %s\n", text("precision").c_str(), text("format").c_str());
  std::printf("  model      %.3f MB (%zu bytes), shared by all instances\n",
              static_cast<double>(model.bytes().size()) / 1e6, model.bytes().size());
  std::printf("  instance   %.1f KiB (%zu bytes) of lent memory per garment\n",
              static_cast<double>(model.instance_bytes()) / 1024, model.instance_bytes());
  std::printf("  tick rate  %g Hz\n", TickRate(model));
  std::printf("  stages    ");
  for (const Json& stage : json["stages"]) std::printf(" %s", stage.get<std::string>().c_str());
  std::printf("; %.2f million multiply-adds a tick\n", json["tick_multiply_adds"].get<double>() / 1e6);
  const Json& patches = json["patches"];
  if (!patches.is_null()) {
    std::printf(
        "  patches    %u of %u points, %u features; a vertex follows %u points; %.3f MB of weights; played at\n"
        "             the levels skeleton and mesh alike\n",
        patches["patches"].get<unsigned>(), patches["points"].get<unsigned>(), patches["width"].get<unsigned>(),
        patches["sources"].get<unsigned>(), patches["weight_bytes"].get<double>() / 1e6);
  }
  std::printf("  joints     %zu:", model.joint_names().size());
  size_t column = 0;
  for (const std::string& name : model.joint_names()) {
    if (column + name.size() > 84) {
      std::printf("\n            ");
      column = 0;
    }
    std::printf(" %s", converter::PrintableText(name).c_str());
    column += name.size() + 1;
  }
  std::printf("\n");
  return kExitGood;
}

}  // namespace

void AddInspect(CLI::App& app, int& exit_code) {
  auto options = std::make_shared<Options>();
  CLI::App* command = app.add_subcommand("inspect", "Show what a model file contains");
  command->add_option("MODEL", options->model, "a .dcloth file")->required();
  command->add_flag("--json", options->json, "one JSON object on stdout");
  command->callback([options, &exit_code] { exit_code = Inspect(*options); });
}

}  // namespace dcloth::tools
