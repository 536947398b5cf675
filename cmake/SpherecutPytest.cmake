# spherecut_pytest(LABEL [VARIABLE=VALUE...]): a test for each test_*.py of this folder, with the label, in an environment that
# knows source, build and program. A file of which every test is skipped counts as skipped. Sets SPHERECUT_HAS_PYTEST.
function(spherecut_pytest label)
  set(missing TRUE)
  if(Python3_EXECUTABLE)
    execute_process(COMMAND "${Python3_EXECUTABLE}" -c "import pytest" RESULT_VARIABLE missing OUTPUT_QUIET ERROR_QUIET)
  endif()
  if(missing)
    message(NOTICE "  NOTE: pytest is not there (python3-pytest): THE TESTS WITH THE LABEL ${label} ARE NOT RUN.")
    set(SPHERECUT_HAS_PYTEST FALSE PARENT_SCOPE)
    return()
  endif()
  file(GLOB files CONFIGURE_DEPENDS test_*.py)
  foreach(file IN LISTS files)
    cmake_path(GET file STEM name)
    add_test(NAME "${label}: ${name}" COMMAND "${Python3_EXECUTABLE}" -m pytest -q -rs -p no:cacheprovider "${file}"
      WORKING_DIRECTORY "${CMAKE_CURRENT_BINARY_DIR}")
    set_tests_properties("${label}: ${name}" PROPERTIES LABELS "${label}" TIMEOUT 900
      SKIP_REGULAR_EXPRESSION "\n[0-9]+ skipped in" ENVIRONMENT
      "SPHERECUT_SOURCE=${PROJECT_SOURCE_DIR};SPHERECUT_BUILD=${PROJECT_BINARY_DIR};SPHERECUT_COMMAND=$<TARGET_FILE:spherecut>;OPENBLAS_NUM_THREADS=1;MPLBACKEND=Agg;PYTHONDONTWRITEBYTECODE=1;${ARGN}")
  endforeach()
  set(SPHERECUT_HAS_PYTEST TRUE PARENT_SCOPE)
endfunction()
