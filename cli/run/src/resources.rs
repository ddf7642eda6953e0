//! Room on disk and in memory, as far as the system says.
//!
//! Does not know: what the room is for.

use std::path::Path;

/// Bytes that can be written to the file system of a path, whose folder is there; none where that is not known.
pub fn free_space(path: &Path) -> Option<u64> {
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    of_folder(folder)
}

#[cfg(unix)]
#[allow(clippy::useless_conversion, reason = "some systems count blocks in 32 bits")]
fn of_folder(folder: &Path) -> Option<u64> {
    let found = nix::sys::statvfs::statvfs(folder).ok()?;
    // Some file systems of networks and of memory say nothing.
    let bytes = u64::from(found.blocks_available()).saturating_mul(u64::from(found.fragment_size()));
    (found.blocks() > 0).then_some(bytes)
}

#[cfg(not(unix))]
fn of_folder(_: &Path) -> Option<u64> {
    None
}

/// Bytes of memory that a process can get without moving others to disk; none where that is not known.
pub fn free_memory() -> Option<u64> {
    let text = std::fs::read_to_string("/proc/meminfo").ok()?;
    let line = text.lines().find_map(|line| line.strip_prefix("MemAvailable:"))?;
    let kilobytes: u64 = line.trim().strip_suffix(" kB")?.trim().parse().ok()?;
    Some(kilobytes.saturating_mul(1024))
}

/// A number of bytes for people.
pub fn shown(bytes: u128) -> String {
    const UNITS: [(f64, &str); 5] = [(1e15, "PB"), (1e12, "TB"), (1e9, "GB"), (1e6, "MB"), (1e3, "kB")];
    let bytes = bytes as f64;
    match UNITS.iter().find(|(size, _)| bytes >= *size) {
        Some((size, unit)) => format!("{:.1} {unit}", bytes / size),
        None => format!("{bytes} bytes"),
    }
}

#[cfg(test)]
mod tests {
    use super::{free_space, shown};

    #[test]
    fn there_is_some_room() {
        #[cfg(unix)]
        assert!(free_space(&std::env::temp_dir().join("x")).is_some());
        assert_eq!(free_space(std::path::Path::new("/no/such/folder/x")), None);
        assert_eq!(
            [0, 999, 1500, 58_000_000_000_000].map(shown),
            ["0 bytes", "999 bytes", "1.5 kB", "58.0 TB"]
        );
    }
}
