# One step of building the page: cmake -DNODE= -DNPM= -DPAGE=source folder -DBUILD=build tree -P BuildPage.cmake packages|page
# packages: `npm ci` unless node_modules is that of the lock file already. When that fails (no network) a notice is printed
# and the build goes on. page: types, then the bundle into ${BUILD}/page and the tests into ${BUILD}/page-tests; an error
# there fails the build.
math(EXPR last "${CMAKE_ARGC} - 1")
set(step "${CMAKE_ARGV${last}}")
set(packages_stamp "${BUILD}/page-packages.stamp")

function(run what)
  execute_process(COMMAND ${ARGN} WORKING_DIRECTORY "${PAGE}" RESULT_VARIABLE status OUTPUT_VARIABLE said ERROR_VARIABLE said)
  if(NOT status EQUAL 0)
    message(FATAL_ERROR "${what} failed:\n${said}")
  endif()
endfunction()

if(step STREQUAL "packages")
  # Several build trees share node_modules: one npm at a time, and none when the lock file is the one installed.
  file(MAKE_DIRECTORY "${PAGE}/node_modules")
  file(LOCK "${PAGE}/node_modules" DIRECTORY GUARD PROCESS TIMEOUT 600)
  file(SHA256 "${PAGE}/package-lock.json" wanted)
  set(mark "${PAGE}/node_modules/.spherecut-lock")
  set(installed "")
  if(EXISTS "${mark}")
    file(READ "${mark}" installed)
  endif()
  if(NOT installed STREQUAL wanted)
    execute_process(
      COMMAND "${NPM}" ci --ignore-scripts --no-audit --no-fund --prefer-offline --fetch-retries=1 --fetch-timeout=60000
      WORKING_DIRECTORY "${PAGE}" RESULT_VARIABLE status OUTPUT_VARIABLE said ERROR_VARIABLE said)
    if(said MATCHES "EUSAGE|EINTEGRITY")
      message(FATAL_ERROR "package.json and package-lock.json do not agree:\n${said}")
    endif()
    if(NOT status EQUAL 0)
      string(REGEX MATCH "npm (ERR!|error)[^\n]*" first "${said}")
      message(NOTICE "
  NOTE: the packages of the page could not be installed (${first}).
  The page of `spherecut serve` is NOT built and its tests will be skipped; everything else is. npm needs the network
  once; the next build tries again.
")
      file(REMOVE "${packages_stamp}")
      return()
    endif()
    file(WRITE "${mark}" "${wanted}")
  endif()
  file(WRITE "${packages_stamp}" "${wanted}")
elseif(step STREQUAL "page")
  if(NOT EXISTS "${packages_stamp}")
    return()
  endif()
  run("Type check of the page" "${NODE}" node_modules/typescript/bin/tsc --noEmit)
  run("Bundling of the page" "${NODE}" node_modules/vite/bin/vite.js build --outDir "${BUILD}/page" --emptyOutDir --logLevel warn)
  file(GLOB tests "${PAGE}/tests/*.test.ts")
  list(APPEND tests "${PAGE}/tests/measure.ts" "${PAGE}/tests/moving_picture.ts" "${PAGE}/tests/pictures.ts" "${PAGE}/tests/soak.ts")
  run("Bundling of the page's tests" "${NODE}" node_modules/esbuild/bin/esbuild ${tests} --bundle --platform=node
    --target=node18 --format=esm --packages=external --out-extension:.js=.mjs --outdir=${BUILD}/page-tests --log-level=warning)
  file(CREATE_LINK "${PAGE}/node_modules" "${BUILD}/page-tests/node_modules" SYMBOLIC)
  file(WRITE "${BUILD}/page.stamp" "")
else()
  message(FATAL_ERROR "unknown step '${step}'")
endif()
