# hpr_library(name SOURCES ... DEPENDS ... PRIVATE_DEPENDS ... TESTS ...): one folder, one static library, its unit tests
# beside it.
function(hpr_library name)
  cmake_parse_arguments(ARG "" "" "SOURCES;DEPENDS;PRIVATE_DEPENDS;TESTS" ${ARGN})
  add_library(hpr_${name} STATIC ${ARG_SOURCES})
  add_library(hpr::${name} ALIAS hpr_${name})
  target_link_libraries(hpr_${name} PUBLIC hpr::options ${ARG_DEPENDS} PRIVATE ${ARG_PRIVATE_DEPENDS})
  target_precompile_headers(hpr_${name} REUSE_FROM hpr_library_headers)
  if(ARG_TESTS AND BUILD_TESTING)
    hpr_unit_test(${name}_test SOURCES ${ARG_TESTS} DEPENDS hpr::${name} PREFIX ${name})
  endif()
endfunction()

# hpr_links(result target library): whether the target links the library, itself or through others.
function(hpr_links result target library)
  set(${result} OFF)
  get_target_property(links ${target} LINK_LIBRARIES)
  foreach(link IN LISTS links)
    if(${result} OR NOT link MATCHES "^hpr::")
      continue()
    endif()
    if(link STREQUAL library)
      set(${result} ON)
    else()
      hpr_links(${result} ${link} ${library})
    endif()
  endforeach()
  set(${result} ${${result}} PARENT_SCOPE)
endfunction()

# hpr_unit_test(target SOURCES ... DEPENDS ... PREFIX p [LABELS ...] [TIMEOUT s]): GoogleTests of one process. The label is
# `unit` (also run under the sanitizers) unless others are given; `gl` runs under the address sanitizer only. Programs that
# link hpr::raster may draw, and software GL hands the unwinder code made at run time; looking that up, the unwinder
# allocates while it holds its lock, and an allocation that the address sanitizer unwinds the slow way waits for that lock
# for ever. So these unwind by frame pointers.
add_custom_target(hpr_unit_tests)  # every test program with label `unit` or `gl`: all that the sanitizers need built
function(hpr_unit_test target)
  cmake_parse_arguments(ARG "" "PREFIX;TIMEOUT" "SOURCES;DEPENDS;LABELS" ${ARGN})
  if(NOT ARG_LABELS)
    set(ARG_LABELS unit)
  endif()
  if(NOT ARG_TIMEOUT)
    set(ARG_TIMEOUT 30)
  endif()
  if(HPR_SANITIZE)
    math(EXPR ARG_TIMEOUT "${ARG_TIMEOUT} * 6")
  endif()
  add_executable(${target} ${ARG_SOURCES})
  target_link_libraries(${target} PRIVATE ${ARG_DEPENDS} GTest::gtest_main)
  target_precompile_headers(${target} REUSE_FROM hpr_test_headers)
  set(environment "${HPR_TEST_ENVIRONMENT}")
  if("gpu" IN_LIST ARG_LABELS)
    set(environment "${HPR_GPU_TEST_ENVIRONMENT}")
  endif()
  hpr_links(draws ${target} hpr::raster)
  if(draws)
    string(REPLACE "fast_unwind_on_malloc=0" "fast_unwind_on_malloc=1" environment "${environment}")
  endif()
  if("unit" IN_LIST ARG_LABELS OR "gl" IN_LIST ARG_LABELS)
    add_dependencies(hpr_unit_tests ${target})
  endif()
  gtest_discover_tests(${target} TEST_PREFIX "${ARG_PREFIX}." NO_PRETTY_VALUES DISCOVERY_TIMEOUT 60
                       PROPERTIES LABELS "${ARG_LABELS}" TIMEOUT ${ARG_TIMEOUT})
  # gtest_discover_tests keeps only the first value of a list, so lists are set once the tests are known.
  set(properties_script ${CMAKE_CURRENT_BINARY_DIR}/${target}_properties.cmake)
  file(WRITE ${properties_script}
    "if(${target}_TESTS)
  set_tests_properties(\${${target}_TESTS} PROPERTIES ENVIRONMENT \"${environment}\")
endif()
foreach(test IN LISTS ${target}_TESTS)
  if(test MATCHES [[${HPR_FAULT_TESTS}]])
    set_tests_properties(\${test} PROPERTIES LABELS \"${ARG_LABELS};fault\")
  endif()
endforeach()
")
  set_property(DIRECTORY APPEND PROPERTY TEST_INCLUDE_FILES ${properties_script})
endfunction()

# hpr_mpi_test(name DEPENDS ... RANKS 1 2 3 ...): name.cpp with the main of tests/mpi_main.cpp, under mpiexec once per rank
# count. Built but not run for sanitizers, which the MPI library is not built for; there ranks are threads.
function(hpr_mpi_test name)
  cmake_parse_arguments(ARG "" "" "DEPENDS;RANKS" ${ARGN})
  add_executable(${name} ${name}.cpp ${PROJECT_SOURCE_DIR}/tests/mpi_main.cpp)
  target_link_libraries(${name} PRIVATE ${ARG_DEPENDS} GTest::gtest)
  if(HPR_SANITIZE)
    return()
  endif()
  foreach(ranks IN LISTS ARG_RANKS)
    add_test(NAME ${name}.np${ranks} COMMAND ${MPIEXEC_EXECUTABLE} ${MPIEXEC_NUMPROC_FLAG} ${ranks} ${MPIEXEC_PREFLAGS}
             $<TARGET_FILE:${name}>)
    set_tests_properties(${name}.np${ranks} PROPERTIES LABELS mpi PROCESSORS ${ranks} TIMEOUT 180
      ENVIRONMENT "${HPR_TEST_ENVIRONMENT}")
  endforeach()
endfunction()
