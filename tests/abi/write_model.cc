// Writes a synthetic model for the consumers of this folder. Argument: where to.
#include <cstdio>

#include "tests/unit/engine/model_builder.h"

int main(int argc, char** argv) {
  if (argc != 2) return 2;
  dcloth::testing::ModelSpec spec;
  spec.precision = dcloth::format::DType_I8;
  spec.texture = true;
  const dcloth::AlignedBytes bytes = dcloth::testing::BuildModel(spec).Bytes();
  std::FILE* file = std::fopen(argv[1], "wb");
  if (file == nullptr) return 1;
  const bool written = std::fwrite(bytes.data(), 1, bytes.size(), file) == bytes.size();
  return std::fclose(file) == 0 && written ? 0 : 1;
}
