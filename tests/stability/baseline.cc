#include "tests/stability/baseline.h"

#include <map>
#include <utility>
#include <vector>

#include "tests/stability/player.h"
#include "tests/stability/statistics.h"

namespace dcloth::stability {

const Baseline& BaselineOf(const Garment& garment, Precision precision) {
  static std::map<std::pair<std::string, Precision>, Baseline> measured;
  const auto [entry, fresh] = measured.try_emplace({garment.name, precision});
  if (!fresh) return entry->second;
  const auto second = static_cast<size_t>(0.5 + garment.bundle.tick_rate);
  const size_t floats = 3 * garment.vertex_count();
  Player player(garment, precision);
  std::vector<double> errors_mm;
  for (const Clip& clip : garment.clips) {
    player.Reset();
    for (size_t frame = 0; frame < clip.motion.size(); ++frame) {
      errors_mm.push_back(
          MeanDistanceMm(player.Step(clip.motion[frame]), {&clip.truth[frame * floats], floats}));
    }
    errors_mm.resize(errors_mm.size() / second * second);  // no batch spans two clips
  }
  entry->second = {Mean(errors_mm), BatchStandardError(errors_mm, second)};
  return entry->second;
}

}  // namespace dcloth::stability
