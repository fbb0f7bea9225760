//! A test in a process of its own: for what depends on environment variables, or counts what the process holds.

use std::process::Command;

const CHILD: &str = "VRTM_TEST_CHILD";

/// Runs the test `name`, with its module's name before it, again in a child process with other variables. Returns true
/// in the child.
///
/// The test must not print in the child: all that appears on stdout or stderr comes from the library.
pub fn in_a_child(name: &str, variables: &[(&str, &str)]) -> bool {
    if std::env::var_os(CHILD).is_some() {
        return true;
    }
    let output = Command::new(std::env::current_exe().unwrap())
        .args(["--exact", name, "--nocapture", "--test-threads=1"])
        .env_remove("VRTM_DEVICE")
        .env_remove("VRTM_THREADS")
        .env_remove("VRTM_GPU_LIMITS")
        // Without it, a layer of Mesa's Vulkan drivers prints a warning to stderr.
        .env("XDG_RUNTIME_DIR", env!("CARGO_TARGET_TMPDIR"))
        .envs(variables.iter().copied())
        .env(CHILD, "1")
        .output()
        .unwrap();
    let said = String::from_utf8_lossy(&output.stdout);
    assert!(output.status.success() && said.contains("1 passed"), "{variables:?}: {output:?}");
    assert!(output.stderr.is_empty(), "{variables:?}: {}", String::from_utf8_lossy(&output.stderr));
    let harness = ["running 1 test", "test ", "test result: "];
    let foreign =
        said.lines().find(|line| !line.is_empty() && !harness.iter().any(|own| line.starts_with(own)));
    assert_eq!(foreign, None, "{variables:?}");
    false
}
