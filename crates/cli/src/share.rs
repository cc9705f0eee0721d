//! [`Share`]: a part of a study that one of several machines runs.

use std::str::FromStr;

/// One share of the cells, as in `2/5`.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Share {
    pub(crate) index: usize,
    pub(crate) count: usize,
}

impl FromStr for Share {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        let numbers = text.split_once('/').and_then(|(index, count)| {
            let numbers: [usize; 2] = [index.parse().ok()?, count.parse().ok()?];
            Some(numbers)
        });
        match numbers {
            Some([index, count]) if (1..=count).contains(&index) => Ok(Self { index, count }),
            _ => Err("a share such as 2/5, the second of five, is needed".to_owned()),
        }
    }
}

impl Share {
    /// True if the share contains the cell of this number, from 0.
    pub(crate) fn has(self, cell: usize) -> bool {
        cell % self.count == self.index - 1
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shares_have_every_cell_once() {
        let shares: Vec<Share> = (1..=3).map(|i| format!("{i}/3").parse().unwrap()).collect();
        for cell in 0..20 {
            assert_eq!(shares.iter().filter(|share| share.has(cell)).count(), 1);
        }
        for wrong in ["", "0/5", "6/5", "1", "a/b", "1/0", "-1/2"] {
            assert!(wrong.parse::<Share>().is_err(), "{wrong}");
        }
    }
}
