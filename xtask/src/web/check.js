// The test of the page: see `cargo xtask web --check`.
(async () => {
  const canvas = document.getElementById("incise");
  const pause = (ms) => new Promise((done) => setTimeout(done, ms));
  const number = (name) => Number(canvas.dataset[name] ?? 0);
  const until = async (condition) => {
    while (!condition() && canvas.dataset.error === undefined) await pause(100);
  };
  const point = (type, x, y, buttons) => {
    const options = {
      clientX: x, clientY: y, button: 0, buttons, bubbles: true, cancelable: true,
      pointerId: 1, pointerType: "mouse", isPrimary: true,
    };
    canvas.dispatchEvent(new PointerEvent(`pointer${type}`, options));
    const mouse = { down: "mousedown", move: "mousemove", up: "mouseup" }[type];
    canvas.dispatchEvent(new MouseEvent(mouse, options));
  };
  await until(() => number("frame") >= 3);
  const before = { pieces: number("pieces"), tets: number("tets") };
  // The body is in the middle of the part of the canvas that the panel leaves.
  const { width, height } = canvas.getBoundingClientRect();
  const x = (width - 340) / 2;
  point("move", x, height * 0.1, 0);
  await pause(200);
  point("down", x, height * 0.1, 1);
  for (let step = 1; step <= 30; step++) {
    await pause(60);
    point("move", x, height * (0.1 + (0.8 * step) / 30), 1);
  }
  await pause(200);
  point("up", x, height * 0.9, 0);
  const last = performance.now() + 120000;
  await until(() => number("pieces") === 2 || performance.now() > last);
  const outcome = {
    pieces: [before.pieces, number("pieces")],
    tets: [before.tets, number("tets")],
    frame: number("frame"),
    error: canvas.dataset.error ?? null,
  };
  await fetch("/report", { method: "POST", body: JSON.stringify(outcome) });
})();
