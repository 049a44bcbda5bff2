# What nearly every file reads, read once: half of the time to compile is spent on headers of others. GCC takes a precompiled
# header where the flags that made it are the flags in use, so that what goes into a library and what goes into a test program
# have one each. Every file still includes what it uses: scripts/tidy reads them without (CMAKE_DISABLE_PRECOMPILE_HEADERS).
set(headers <algorithm> <array> <chrono> <cmath> <cstdint> <cstring> <filesystem> <functional> <limits> <map> <memory>
  <optional> <span> <string> <string_view> <utility> <vector> <fmt/format.h> <glm/glm.hpp>)

file(CONFIGURE OUTPUT ${PROJECT_BINARY_DIR}/generated/headers.cpp CONTENT "int main() {}\n")
add_library(hpr_library_headers OBJECT EXCLUDE_FROM_ALL ${PROJECT_BINARY_DIR}/generated/headers.cpp)
target_link_libraries(hpr_library_headers PRIVATE hpr::options fmt::fmt glm::glm)
target_precompile_headers(hpr_library_headers PRIVATE ${headers})
if(BUILD_TESTING)
  add_executable(hpr_test_headers EXCLUDE_FROM_ALL ${PROJECT_BINARY_DIR}/generated/headers.cpp)
  target_link_libraries(hpr_test_headers PRIVATE hpr::options fmt::fmt glm::glm GTest::gtest)
  target_precompile_headers(hpr_test_headers PRIVATE ${headers} <gtest/gtest.h>)
endif()
