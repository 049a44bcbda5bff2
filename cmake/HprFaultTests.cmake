# Label `fault`: the tests that the table of docs/reliability.md names in its last column, whole or up to a dot. The table is
# the only list; tests/fault_table_test.py holds that each of its names is a test.
set_property(DIRECTORY APPEND PROPERTY CMAKE_CONFIGURE_DEPENDS ${PROJECT_SOURCE_DIR}/docs/reliability.md)
file(STRINGS ${PROJECT_SOURCE_DIR}/docs/reliability.md rows REGEX "^\\| [^W]")  # not the head
set(names "")
foreach(row IN LISTS rows)
  string(REGEX REPLACE "^.*\\|([^|]*)\\|$" "\\1" last "${row}")
  string(REGEX MATCHALL "[A-Za-z0-9_.]+" found "${last}")
  list(APPEND names ${found})
endforeach()
list(REMOVE_DUPLICATES names)
string(REPLACE "." "\\." names "${names}")
list(JOIN names "|" names)
set(HPR_FAULT_TESTS "^(${names})(\\.|$)")

# Adds the label to those tests of the current folder that were added by add_test().
function(hpr_label_fault_tests)
  get_property(tests DIRECTORY PROPERTY TESTS)
  foreach(test IN LISTS tests)
    if(test MATCHES "${HPR_FAULT_TESTS}")
      set_property(TEST ${test} APPEND PROPERTY LABELS fault)
    endif()
  endforeach()
endfunction()
