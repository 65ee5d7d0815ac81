// Writes the seed corpora: `fuzz_write_seeds FOLDER` fills FOLDER/model, FOLDER/bundle and so on.
#include <cstdio>
#include <filesystem>
#include <fstream>

#include "tests/fuzz/targets.h"

int main(int argc, char** argv) {
  if (argc != 2) {
    std::fprintf(stderr, "usage: %s FOLDER\n", argv[0]);
    return 2;
  }
  for (const dcloth::testing::FuzzTarget& target : dcloth::testing::kFuzzTargets) {
    const std::filesystem::path folder = std::filesystem::path(argv[1]) / target.name;
    std::filesystem::create_directories(folder);
    size_t count = 0;
    for (const dcloth::testing::Seed& seed : dcloth::testing::Seeds(target.name)) {
      std::ofstream file(folder / seed.name, std::ios::binary);
      file.write(reinterpret_cast<const char*>(seed.bytes.data()),
                 static_cast<std::streamsize>(seed.bytes.size()));
      if (!file.flush()) {
        std::fprintf(stderr, "%s: cannot be written\n", (folder / seed.name).c_str());
        return 1;
      }
      ++count;
    }
    std::printf("%s: %zu seeds\n", folder.c_str(), count);
  }
  return 0;
}
