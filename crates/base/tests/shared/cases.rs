//! Tables of cases as text.

/// One case a line, its cells parted by ` | `; `-` is an empty cell.
pub fn cases<const N: usize>(table: &str) -> impl Iterator<Item = [&str; N]> {
    let lines = table.lines().filter(|line| !line.trim().is_empty());
    lines.map(|line| {
        let cells = line.split(" | ").map(str::trim);
        let cells: Vec<&str> = cells
            .map(|cell| if cell == "-" { "" } else { cell })
            .collect();
        cells.try_into().unwrap()
    })
}
