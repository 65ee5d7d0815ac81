// The tests' own main: after the last one the record is printed and written.
#include <gtest/gtest.h>

#include "tests/stability/record.h"

int main(int argc, char** argv) {
  testing::InitGoogleTest(&argc, argv);
  const int failed = RUN_ALL_TESTS();
  return dcloth::stability::WriteRecords() ? failed : 1;
}
