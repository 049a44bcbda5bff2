# What `cmake --install` leaves: the program, and below it a library for strategies of one's own: find_package(HPR) gives
# hpr::core, hpr::image, hpr::scene, hpr::transport, hpr::distribution, hpr::compositing and what they depend on.
include(CMakePackageConfigHelpers)

install(TARGETS hpr RUNTIME DESTINATION ${CMAKE_INSTALL_BINDIR})
install(TARGETS hpr_imageio LIBRARY DESTINATION ${CMAKE_INSTALL_LIBDIR})

set(library core image scene transport distribution compositing)
foreach(part IN LISTS library ITEMS options version)
  set_target_properties(hpr_${part} PROPERTIES EXPORT_NAME ${part})
  install(TARGETS hpr_${part} EXPORT HPRTargets ARCHIVE DESTINATION ${CMAKE_INSTALL_LIBDIR})
endforeach()
install(DIRECTORY core image scene cluster compositing DESTINATION ${CMAKE_INSTALL_INCLUDEDIR}/hpr FILES_MATCHING PATTERN "*.h")
install(FILES ${PROJECT_BINARY_DIR}/generated/hpr/version.h DESTINATION ${CMAKE_INSTALL_INCLUDEDIR}/hpr/hpr)

set(package ${CMAKE_INSTALL_LIBDIR}/cmake/HPR)
install(EXPORT HPRTargets NAMESPACE hpr:: DESTINATION ${package})
configure_package_config_file(${CMAKE_CURRENT_LIST_DIR}/HPRConfig.cmake.in ${PROJECT_BINARY_DIR}/HPRConfig.cmake
  INSTALL_DESTINATION ${package})
write_basic_package_version_file(${PROJECT_BINARY_DIR}/HPRConfigVersion.cmake COMPATIBILITY SameMinorVersion)
install(FILES ${PROJECT_BINARY_DIR}/HPRConfig.cmake ${PROJECT_BINARY_DIR}/HPRConfigVersion.cmake DESTINATION ${package})
