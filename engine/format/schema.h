// The one way to the generated schema code, so that every file sees the same settings. Only engine/format includes it.
#ifndef DCLOTH_ENGINE_FORMAT_SCHEMA_H_
#define DCLOTH_ENGINE_FORMAT_SCHEMA_H_

#ifndef FLATBUFFERS_MAX_ALIGNMENT
#define FLATBUFFERS_MAX_ALIGNMENT 64  // FlatBuffers' own 32 would refuse the weights' force_align
#endif
// A library inside a game never aborts: whatever these asserts guard, verify.cc has checked before.
#ifndef FLATBUFFERS_ASSERT
#define FLATBUFFERS_ASSERT(condition) ((void)0)
#endif

#include "dcloth_generated.h"

#endif  // DCLOTH_ENGINE_FORMAT_SCHEMA_H_
