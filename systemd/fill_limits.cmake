# Writes mapletd.service and mapletd@.service: the templates, with each limit of
# mapletd --print-unit-limits in the place of KEY=@KEY@.
execute_process(COMMAND ${EMULATOR} ${MAPLETD} --print-unit-limits OUTPUT_VARIABLE limits
                COMMAND_ERROR_IS_FATAL ANY)
string(REGEX MATCHALL "[A-Za-z]+=[0-9A-Z]+" limits "${limits}")
foreach(unit "one.service;mapletd.service" "several.service;mapletd@.service")
  list(GET unit 0 from)
  list(GET unit 1 to)
  file(READ ${from} text)
  foreach(limit ${limits})
    string(REGEX REPLACE "=.*" "" key ${limit})
    string(REPLACE "${key}=%${key}%" "${limit}" text "${text}")
  endforeach()
  file(WRITE ${to} "${text}")
endforeach()
