#include "tools/html_report.h"

#include <deque>
#include <span>
#include <stdexcept>
#include <string_view>

#include "converter/file.h"
#include "tools/blob.h"

namespace dcloth::tools {
namespace {

constexpr unsigned char kPage[] = {
#include "report_page.inc"
};

std::span<const std::byte> Bytes(std::string_view text) { return std::as_bytes(std::span(text.data(), text.size())); }

// JSON inside a script element: '<' could end the element, so it is written as an escape.
std::string ScriptJson(const Json& json) {
  std::string out;
  for (char c : DumpJson(json, -1)) {
    if (c == '<') {
      out += "\\u003c";
    } else {
      out += c;
    }
  }
  return out;
}

// Numbered <script> elements, so that the page unpacks only what it shows.
class Blobs {
 public:
  template <typename T>
  size_t Add(const std::vector<T>& values) {
    return AddPacked(owned_.emplace_back(PackBlob(std::as_bytes(std::span(values)))));
  }

  // `blob` outlives the page.
  size_t AddPacked(std::string_view blob) {
    const std::string_view begin =
        owned_.emplace_back("<script type=\"application/octet-stream\" id=\"blob-" + std::to_string(count_) + "\">");
    for (const std::string_view piece : {begin, blob, kEnd}) html_.push_back(std::as_bytes(std::span(piece)));
    return count_++;
  }

  const std::vector<std::span<const std::byte>>& html() const { return html_; }

 private:
  static constexpr std::string_view kEnd = "</script>\n";

  std::deque<std::string> owned_;  // which stay in their places
  std::vector<std::span<const std::byte>> html_;
  size_t count_ = 0;
};

Json SequenceJson(std::span<const int32_t> parents, ReportSequence* sequence, Blobs* blobs) {
  Json json = {{"name", sequence->name},
               {"fps", sequence->fps},
               {"frames", sequence->origins.size() / 3},
               {"origins", blobs->Add(sequence->origins)},
               {"hips", blobs->Add(sequence->hips)},
               {"joints", blobs->Add(sequence->joints)},
               {"tracks", Json::array()},
               {"error_mm", Json::object()}};
  if (!sequence->tracks.empty() && !sequence->tracks.front().values.empty()) PackFrames(parents, sequence->tracks);
  for (const Track& track : sequence->tracks) {
    Json parts = Json::array();
    for (const PackedFrames& part : track.packed) {
      parts.push_back({{"frames", part.frames},
                       {"predictor", static_cast<int>(part.predictor)},
                       {"reference", part.reference},
                       {"data", blobs->AddPacked(part.blob)}});
    }
    json["tracks"].push_back({{"name", track.name}, {"parts", parts}});
  }
  for (const auto& [name, errors] : sequence->error_mm) json["error_mm"][name] = errors;
  return json;
}

void AddParts(const ReportBody& body, Blobs* blobs, Json* json) {
  (*json)["same"] = blobs->Add(body.same);
  (*json)["texture_coordinates"] = blobs->Add(body.texture_coordinates);
  (*json)["parts"] = Json::array();
  (*json)["pictures"] = Json::array();
  for (const ReportPart& part : body.parts) {
    (*json)["parts"].push_back({{"first", part.first},
                                {"count", part.count},
                                {"colour", part.colour},
                                {"picture", part.picture},
                                {"cut_out", part.cut_out}});
  }
  for (const std::vector<std::byte>& picture : body.pictures) (*json)["pictures"].push_back(blobs->Add(picture));
}

}  // namespace

void WriteHtmlReport(const std::filesystem::path& path, Report* report) {
  Blobs blobs;
  Json json = {{"title", report->title},
               {"subtitle", report->subtitle},
               {"facts", report->facts},
               {"cpu", report->cpu},
               {"quantum_mm", kQuantumMm},
               {"vertex_count", report->vertex_count},
               {"joint_count", report->joint_count},
               {"faces", blobs.Add(report->triangles)},
               {"body", nullptr},
               {"sticks", report->sticks},
               {"variants", report->variants},
               {"sequences", Json::array()}};
  if (report->body) {
    json["body"] = {{"count", report->body->positions.size() / 3},
                    {"positions", blobs.Add(report->body->positions)},
                    {"faces", blobs.Add(report->body->faces)},
                    {"joints", blobs.Add(report->body->joints)},
                    {"weights", blobs.Add(report->body->weights)}};
    if (!report->body->colours.empty()) json["body"]["colours"] = blobs.Add(report->body->colours);
    if (!report->body->parts.empty()) AddParts(*report->body, &blobs, &json["body"]);
  }
  const std::vector<int32_t> parents = SpatialParents(report->triangles, report->vertex_count);
  for (ReportSequence& sequence : report->sequences) {
    json["sequences"].push_back(SequenceJson(parents, &sequence, &blobs));
  }
  const std::string data = ScriptJson(json);

  const std::string_view page(reinterpret_cast<const char*>(kPage), sizeof(kPage));
  constexpr std::string_view kDataMark = "@DATA@", kBlobsMark = "@BLOBS@";
  const size_t data_at = page.find(kDataMark), blobs_at = page.find(kBlobsMark);
  if (data_at == page.npos || blobs_at == page.npos || blobs_at < data_at) {
    throw std::logic_error("report.html lacks @DATA@ before @BLOBS@");
  }
  const size_t after_data = data_at + kDataMark.size(), after_blobs = blobs_at + kBlobsMark.size();
  std::vector<std::span<const std::byte>> pieces = {Bytes(page.substr(0, data_at)), Bytes(data),
                                                    Bytes(page.substr(after_data, blobs_at - after_data))};
  pieces.insert(pieces.end(), blobs.html().begin(), blobs.html().end());
  pieces.push_back(Bytes(page.substr(after_blobs)));
  converter::WriteFileAtomically(path, pieces);
}

}  // namespace dcloth::tools
