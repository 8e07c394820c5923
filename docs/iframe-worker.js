// Search in pages opened from disk: browsers start no worker there, so its script runs in a frame.
if (location.protocol === "file:") {
  window.IFrameWorker = window.Worker = class extends EventTarget {
    constructor(url) {
      super();
      this.frame = document.createElement("iframe");
      this.frame.hidden = true;
      this.frame.srcdoc = `<script src="${url}"></script>`;
      this.loaded = new Promise((loaded) => (this.frame.onload = loaded));
      this.loaded.then(() => {
        const answer = (data) => this.dispatchEvent(new MessageEvent("message", { data }));
        this.frame.contentWindow.postMessage = answer;
      });
      document.body.append(this.frame);
    }
    postMessage(data) {
      const message = new MessageEvent("message", { data });
      this.loaded.then(() => this.frame.contentWindow.dispatchEvent(message));
    }
    terminate() {
      this.frame.remove();
    }
  };
}
