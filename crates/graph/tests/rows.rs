//! Ragged arrays that change, compared with lists of lists.

use incise_graph::Rows;
use proptest::collection::vec;
use proptest::prelude::*;

#[derive(Clone, Debug)]
enum Edit {
    Push(u32),
    Insert(usize, u32),
    Remove(usize),
    SwapRemove(usize),
    Pop,
    Resize(usize),
}

fn edit() -> impl Strategy<Value = (usize, Edit)> {
    let edit = prop_oneof![
        8 => any::<u32>().prop_map(Edit::Push),
        4 => (any::<usize>(), any::<u32>()).prop_map(|(at, value)| Edit::Insert(at, value)),
        2 => any::<usize>().prop_map(Edit::Remove),
        2 => any::<usize>().prop_map(Edit::SwapRemove),
        1 => Just(Edit::Pop),
        1 => (0usize..8).prop_map(Edit::Resize),
    ];
    (any::<usize>(), edit)
}

proptest! {
    #[test]
    fn rows_are_lists(
        entries in vec((0usize..5, any::<u32>()), 0..30),
        edits in vec(edit(), 0..300),
    ) {
        let mut rows = Rows::default();
        rows.refill(5, entries.iter().copied());
        let mut lists = vec![Vec::new(); 5];
        for &(row, value) in &entries {
            lists[row].push(value);
        }
        for (row, edit) in edits {
            if let Edit::Resize(count) = edit {
                rows.set_row_count(count);
                lists.resize(count, Vec::new());
                continue;
            }
            if lists.is_empty() {
                continue;
            }
            let row = row % lists.len();
            let list = &mut lists[row];
            match edit {
                Edit::Push(value) => {
                    rows.push(row, value);
                    list.push(value);
                }
                Edit::Insert(at, value) => {
                    let at = at % (list.len() + 1);
                    rows.insert(row, at, value);
                    list.insert(at, value);
                }
                Edit::Remove(at) if !list.is_empty() => {
                    let at = at % list.len();
                    rows.remove(row, at);
                    list.remove(at);
                }
                Edit::SwapRemove(at) if !list.is_empty() => {
                    let at = at % list.len();
                    prop_assert_eq!(rows.swap_remove(row, at), list.swap_remove(at));
                }
                Edit::Pop => prop_assert_eq!(rows.pop(row), list.pop()),
                _ => {}
            }
            rows.tidy();
            prop_assert!(rows.rows().eq(lists.iter().map(Vec::as_slice)));
            prop_assert_eq!(rows.row_count(), lists.len());
            prop_assert_eq!(rows.value_count(), lists.iter().map(Vec::len).sum::<usize>());
        }
    }
}

/// Counts moves: in any order of pushes and removals, a value costs a small number of moves.
#[test]
fn a_value_costs_a_constant() {
    for count in [1_000usize, 100_000] {
        let mut rows = Rows::default();
        rows.refill(count, (0..count).map(|row| (row, 0)));
        let mut moved = 0;
        // The worst case for capacities: each row grows by one, then shrinks by one, far from the
        // last one.
        for i in 0..4 * count {
            let row = i * 7919 % count;
            moved += rows.push(row, i);
            if i % 2 == 1 {
                moved += rows.remove(row, 0);
            }
            moved += rows.tidy();
        }
        assert!(moved < 10 * 4 * count, "{moved} for {count}");
    }
}
