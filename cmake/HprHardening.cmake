# What turns a mistake in memory into an end of the process, for programs that read strangers' files: canaries on stacks,
# checked copies, and nothing to write to or jump to once a program runs. tests/hardening_test.py reads it back.
include(CheckCXXCompilerFlag)
include(CheckPIESupported)
check_pie_supported(LANGUAGES CXX)

set(hardening -fstack-protector-strong)
foreach(flag -fstack-clash-protection -fcf-protection=full)
  string(MAKE_C_IDENTIFIER "HPR_HAS${flag}" known)
  check_cxx_compiler_flag(${flag} ${known})
  if(${known})
    list(APPEND hardening ${flag})
  endif()
endforeach()
if(NOT HPR_SANITIZE)  # the sanitizers check more, and do not know the checked copies
  foreach(flag -U_FORTIFY_SOURCE -D_FORTIFY_SOURCE=3)
    list(APPEND hardening $<$<NOT:$<CONFIG:Debug>>:${flag}>)
  endforeach()
endif()
target_compile_options(hpr_options INTERFACE "$<BUILD_INTERFACE:${hardening}>")
target_link_options(hpr_options INTERFACE "$<BUILD_INTERFACE:LINKER:-z,relro;LINKER:-z,now;LINKER:-z,noexecstack>")
