#pragma once

#include <gtest/gtest.h>

#include <atomic>
#include <functional>
#include <string>

#include "cluster/transport/local_communicator.h"
#include "core/error.h"

namespace hpr::test {

/// Runs `body` on `size` ranks and expects every one of them to throw just this.
inline void expect_error_on_all(int size, ExitCode code, const std::string& what,
                                const std::function<void(Communicator&)>& body) {
  std::atomic<int> thrown = 0;
  run_local_ranks(size, [&](Communicator& comm) {
    try {
      body(comm);
    } catch (const Error& error) {
      EXPECT_EQ(error.code(), code);
      EXPECT_EQ(error.what(), what);
      ++thrown;
    }
  });
  EXPECT_EQ(thrown, size);
}

}  // namespace hpr::test
