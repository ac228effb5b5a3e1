// Lines for the end of a post-processor (.cps) of Autodesk Fusion, Inventor CAM or HSMWorks on Windows.
// Posting then also writes PROGRAM.corrected.SUFFIX beside the posted program. Set the two paths.
var olpCommand = "C:/olp/.venv/Scripts/olp.exe";
var olpMachine = "C:/mill/machine.toml";

function onTerminate() {
  var words = ["correct", getOutputPath(), "-m", olpMachine, "--report", getOutputPath() + ".html", "--force"];
  var quoted = [];
  for (var i = 0; i < words.length; ++i) {
    quoted.push("\"" + words[i] + "\"");
  }
  var code = execute(olpCommand, quoted.join(" "), true, "");
  if (code != 0) {
    error("olp has not corrected the program, or it is above tolerance (exit code " + code + "). Call it in a "
      + "terminal to see why: olp " + quoted.join(" "));
  }
}
