# hpr::version: the header hpr/version.h, with the version and the commit this build was configured from.
set(HPR_COMMIT unknown)
find_package(Git QUIET)
if(Git_FOUND)
  execute_process(COMMAND ${GIT_EXECUTABLE} describe --always --dirty WORKING_DIRECTORY ${PROJECT_SOURCE_DIR}
                  OUTPUT_VARIABLE described OUTPUT_STRIP_TRAILING_WHITESPACE ERROR_QUIET RESULT_VARIABLE failed)
  if(NOT failed)
    set(HPR_COMMIT ${described})
  endif()
endif()
configure_file(${CMAKE_CURRENT_LIST_DIR}/version.h.in ${PROJECT_BINARY_DIR}/generated/hpr/version.h @ONLY)
add_library(hpr_version INTERFACE)
add_library(hpr::version ALIAS hpr_version)
target_include_directories(hpr_version INTERFACE $<BUILD_INTERFACE:${PROJECT_BINARY_DIR}/generated>)
