@echo off
rem The editor of a CAM system: Mastercam calls it with the program that it has posted.
rem Put it beside machine.toml. The corrected program opens, or the window says why there is none.
setlocal
if not defined OLP set "OLP=olp"
if not defined OLP_EDITOR set "OLP_EDITOR=notepad"
"%OLP%" correct "%~1" -m "%~dp0machine.toml" -o "%~dpn1.corrected%~x1" --force
if errorlevel 1 (
  pause
  exit /b 1
)
start "" "%OLP_EDITOR%" "%~dpn1.corrected%~x1"
